"""Films of people: consent that names them, and no byte left of who is erased."""

import stat
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from faults.sessions import labcrane
from governance.kept_people import REASON, check_erased, files, store_of
from governed import GOVERNED, TODAY, Lab, edit

from labcrane import ProtocolError
from labcrane.cli.commands.check import examined
from labcrane.participants import recovery as unfinished
from labcrane.participants.copies import inventory
from labcrane.protocol.questions import questions
from labcrane.recording import Channel, StreamHeader
from labcrane.recording.participant_file.columns import (
    write_attributes,
    write_numbers,
    write_text,
)
from labcrane.recording.pictures import CHANNELS, TERMS

FILMED = GOVERNED + (
    "recordings:\n  face: {use: camera, device: /dev/video9, consent: we film your face}\n"
)


def filmed(lab: Lab) -> dict[str, bytes]:
    """Put films next to everybody's participant file, and return the content of each."""
    made = {}
    for name in ("P001", "P002", "P007"):
        for file in ("ses-01_face.mkv", "ses-01_face.2.mkv"):
            made[f"{name}/{file}"] = f"face of {name[1:]} {file}".encode() * 1000
            (lab.places.raw(name) / file).write_bytes(made[f"{name}/{file}"])
    return made


def test_films_are_transferred_and_listed_with_their_session(lab: Lab) -> None:
    filmed(lab)
    done = unfinished.move(lab.places, store_of(lab))
    assert "P007/ses-01_face.2.mkv" in done.copied
    stored, here = files(store_of(lab) / "rehearsal"), files(lab.places.root)
    assert len([name for name in stored if name.endswith(".mkv")]) == 6
    assert all(here[name] == sha for name, sha in stored.items())


def test_a_film_of_an_unfinished_session_is_not_transferred(lab: Lab) -> None:
    filmed(lab)
    folder = lab.places.raw("P001")
    (folder / "ses-02_run.xdf").write_bytes((folder / "ses-01_run.xdf").read_bytes())
    (folder / "ses-02_face.mkv").write_bytes(b"a face")
    done = unfinished.move(lab.places, store_of(lab))
    assert "P001/ses-02_face.mkv" not in done.copied


@pytest.mark.slow
def test_erasing_leaves_no_byte_of_a_film_here_or_in_the_store(lab: Lab) -> None:
    made = filmed(lab)
    unfinished.move(lab.places, store_of(lab))
    done = unfinished.erase(lab.places, "P007", REASON, TODAY)
    check_erased(lab)
    assert done.mentions == []
    for root in (lab.places.root, store_of(lab)):
        left = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
        assert not [path for path, held in left.items() if b"face of 007" in held]
        films = {
            p.relative_to(p.parents[1]).as_posix(): b for p, b in left.items() if p.suffix == ".mkv"
        }
        assert films == {name: held for name, held in made.items() if "P007" not in name}


@pytest.mark.slow
def test_relabelling_moves_films_with_their_participant(lab: Lab) -> None:
    made = filmed(lab)
    unfinished.move(lab.places, store_of(lab))
    unfinished.correct(lab.places, "P007", "P008", "typed wrongly", TODAY)
    for root in (lab.places.root, store_of(lab) / "rehearsal"):
        assert not (root / "P007").exists()
        for file in ("ses-01_face.mkv", "ses-01_face.2.mkv"):
            assert (root / "P008" / file).read_bytes() == made[f"P007/{file}"]


@pytest.mark.slow
@pytest.mark.parametrize("exporter", ["bids", "matlab", "tables", "xdf"])
def test_no_export_contains_a_film(lab: Lab, tmp_path: Path, exporter: str) -> None:
    filmed(lab)
    out = tmp_path / "out"
    done = labcrane("export", lab.places.root, "--to", exporter, "--out", out)
    assert done.communicate()[0].endswith(f"{exporter}: {out}\n")
    made = [path for path in out.rglob("*") if path.is_file()]
    assert made
    assert not [path for path in made if b"face of " in path.read_bytes()]


def listed(lab: Lab, name: str) -> None:
    """List a participant's films in the participant file, as a session does."""
    path = lab.places.raw(name) / f"{name}.h5"
    channels = tuple(Channel(label, unit) for label, unit in CHANNELS.items())
    with h5py.File(path, "r+") as file:
        start = file["ses-01/time"][0]
        stream = file.create_group("ses-01/streams/labcrane.capture.face")
        about = {"name": "labcrane.capture.face", "type": "Capture", "rate_hz": 0.0}
        write_attributes(stream, about)
        write_text(stream, "header", StreamHeader(about["name"], "Capture", channels).xml)
        for column in ("time_raw", "time", "time_error"):
            times = start + np.r_[0:10, 20:30] / 10
            write_numbers(stream, column, times if "error" not in column else 0 * times + 0.01, "s")
        data = stream.create_group("data")
        for at, (label, values) in enumerate(
            {"frame.number": np.r_[0:9, 10, 0:10], "file": np.repeat([1, 2], 10),
             "pts": np.r_[0:10, 0:10] / 10, **dict.fromkeys(TERMS, np.zeros(20))}.items()
        ):  # fmt: skip
            write_numbers(data, f"c{at}", values.astype(float), CHANNELS[label])
            write_attributes(data[f"c{at}"], {"position": at, "name": label})


@pytest.mark.slow
def test_tables_and_bids_list_the_films_and_copy_them_only_when_asked(
    lab: Lab, tmp_path: Path
) -> None:
    made = filmed(lab)
    for name in ("P001", "P002"):
        listed(lab, name)

    def export(to: str, *words: object) -> Path:
        out = tmp_path / f"{to}{len(words)}"
        done = labcrane("export", lab.places.root, "--to", to, "--out", out, *words)
        said = done.communicate()[0]
        assert done.returncode == 0, said
        return out

    films = pd.read_csv(export("tables") / "films.csv")
    assert films["file"].tolist() == ["ses-01_face.mkv", "ses-01_face.2.mkv"] * 2
    assert films["dropped"].tolist() == [1, 0] * 2
    assert films["frames"].tolist() == [10] * 4
    assert films["time_error"].tolist() == pytest.approx([0.01] * 4)
    copies = export("tables", "--set", "films=true") / "films"
    for path in copies.iterdir():
        name, _, file = path.name.partition("_")
        assert path.read_bytes() == made[f"{name}/{file}"]
        assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(
            (lab.places.raw(name) / file).stat().st_mode
        )
    assert len([*copies.iterdir()]) == 4
    for path in export("bids").glob("sub-*/ses-01/motion/*_events.tsv"):
        events = pd.read_csv(path, sep="\t", na_values="n/a")
        rows = events[events["trial_type"] == "film"]
        if len(rows):
            assert rows["film_file"].tolist() == ["ses-01_face.mkv", "ses-01_face.2.mkv"]
            assert rows["onset"].tolist() == pytest.approx([0.0, 2.0], abs=1e-3)
            assert "film_dropped" in path.with_suffix(".json").read_text()
    unfinished.erase(lab.places, "P001", REASON, TODAY)
    assert not [path for path in copies.rglob("*") if b"face of 001" in path.read_bytes()]


@pytest.mark.slow
def test_an_archive_has_no_byte_of_a_film(lab: Lab, tmp_path: Path) -> None:
    filmed(lab)
    out = tmp_path / "out"
    words = ("--set", "license=CC0-1.0", "--set", "authors=[A. B.]")
    done = labcrane("export", lab.places.root, "--to", "zip", "--out", out, *words)
    said = done.communicate()[0]
    assert done.returncode == 0, said
    (packed,) = out.glob("*.zip")
    with zipfile.ZipFile(packed) as archive:
        assert archive.namelist()
        assert not [name for name in archive.namelist() if b"face of " in archive.read(name)]


def test_where_lists_the_folder_with_the_films(lab: Lab) -> None:
    filmed(lab)
    listed = str(inventory(lab.places, "P007"))
    assert str(lab.places.raw("P007")) in listed


def test_bytes_of_a_film_that_look_like_a_pseudonym_are_not_reported(lab: Lab) -> None:
    (lab.places.raw("P001") / "ses-01_face.mkv").write_bytes(b"\x00\x01 P007 \x02")
    assert unfinished.erase(lab.places, "P007", REASON, TODAY).mentions == []


@pytest.fixture
def study(tmp_path: Path) -> Lab:
    return Lab(tmp_path, FILMED)


def test_a_study_is_not_approved_with_a_consent_text_that_does_not_name_a_recording(
    study: Lab,
) -> None:
    with pytest.raises(
        ProtocolError, match=r"study\.yaml:\d+.*does not contain 'we film your face'.*'face'"
    ):
        study.approve()
    edit(study.folder / "consent_v2.txt", "I take part.", "I know that We film\nyour FACE.")
    study.approve()


@pytest.mark.parametrize(
    ("said", "language", "asked"),
    [("a", "en", 1), ("We FILM you", "en", 0), ("deine Face", "de", 0),
     ("eine Kamera", "de", 0), ("a camera", "pl", 1)],
)  # fmt: skip
def test_words_that_name_no_recording_are_asked_about(
    said: str, language: str, asked: int, tmp_path: Path
) -> None:
    lab = Lab(
        tmp_path, FILMED.replace("we film your face", said) + f"page: {{language: {language}}}\n"
    )
    found = [each.text for each in questions(lab.study) if each.key == "recordings.face.consent"]
    assert len(found) == asked
    assert all("name neither recording 'face' nor what it is (" in text for text in found)


def test_check_compares_the_recordings_with_the_consent_text_of_the_approval(study: Lab) -> None:
    edit(study.folder / "consent_v2.txt", "I take part.", "We film your face.")
    study.approve()
    edit(study.protocol, "we film your face", "we film your hands")
    with pytest.raises(ProtocolError, match="does not contain 'we film your hands'"):
        examined(study.protocol)


def test_a_consent_text_that_is_not_text_cannot_name_a_recording(study: Lab) -> None:
    (study.folder / "consent_v2.txt").write_bytes(b"%PDF-1.7 \xff\xfe")
    with pytest.raises(ProtocolError, match=r"cannot be read as text.*give a text file"):
        study.approve()


def test_two_recordings_and_streams_do_not_share_a_name(tmp_path: Path) -> None:
    lab = Lab(tmp_path, FILMED + "streams: {face: {type: EEG}}\n")
    with pytest.raises(ProtocolError, match="'face' is already the name of a stream"):
        _ = lab.study


def test_a_recordings_name_is_the_name_of_a_file(tmp_path: Path) -> None:
    lab = Lab(tmp_path, FILMED.replace("face: {", "'../face': {"))
    with pytest.raises(ProtocolError, match=r"\.\./face"):
        _ = lab.study
