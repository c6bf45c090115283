"""The archive for a repository: complete, checkable, and of nobody by name."""

import csv
import hashlib
import io
import json
import random
import zipfile
from pathlib import Path

import h5py
import pytest
from needs import needs
from programs import ran
from rehearsal import SHORT, ScriptedConsole, a_study
from ruamel.yaml import YAML

from labcrane import ProtocolError, RecordingError, open_recording
from labcrane.analysis import find_cohort
from labcrane.analysis.cohort import Cohort
from labcrane.participants import personal_in
from labcrane.recording import citation
from labcrane.testing import Visit, main, run
from labcrane_tables.archive import CHECKSUMS, Archive
from labcrane_tables.settings import ArchiveSettings

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("archived")
    study = a_study(root, SHORT.replace("movements: 2", "movements: 1"))
    for name in ("P001", "P002"):
        run(Visit(study, name, 1, root / "data", simulated=True, fast=True), ScriptedConsole())
    return root / "data"


@pytest.fixture(scope="module")
def cohort(data: Path) -> Cohort:
    return find_cohort(data, ["simulated"])


@pytest.fixture(scope="module")
def archive(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes."""
    out = tmp_path_factory.mktemp("zip") / "out"
    asked = ["--include", "simulated", "--set", "license=CC-BY-4.0"]
    assert main(["export", str(data), "--to", "zip", "--out", str(out), *asked]) == 0
    return out / "rehearsal.zip"


@pytest.mark.slow
def test_the_archive_has_what_a_repository_asks_for(archive: Path, cohort: Cohort) -> None:
    with zipfile.ZipFile(archive) as file:
        assert file.testzip() is None
        content = {name: file.read(name) for name in file.namelist()}
    top = {name for name in content if "/" not in name}
    assert top == {"README.md", "LICENSE", "CITATION.cff", "codebook.csv", CHECKSUMS,
                   "dataset_description.json"}  # fmt: skip
    for person in cohort.included:
        assert content[f"recordings/{person.name}.h5"] == person.path.read_bytes()
    described = json.loads(content["dataset_description.json"])
    assert described["@context"] == "https://schema.org/"
    assert described["license"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    variables = {each["name"] for each in described["variableMeasured"]}
    for name, text in content.items():
        if name.startswith("data/"):
            assert set(next(csv.reader(io.StringIO(text.decode())))) <= variables
    assert YAML(typ="safe").load(content["CITATION.cff"].decode())["title"] == "labcrane"
    assert b"CC-BY-4.0" in content["LICENSE"]


@pytest.mark.slow
@needs("sha256sum")
def test_every_file_is_checked_by_sha256sum(archive: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(archive).extractall(tmp_path)
    done = ran(["sha256sum", "-c", CHECKSUMS], cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert done.stdout.count(": OK") == len(files) - 1
    around = (archive.parent / "rehearsal.zip.sha256").read_text(encoding="utf-8")
    assert around == f"{hashlib.sha256(archive.read_bytes()).hexdigest()}  rehearsal.zip\n"


@pytest.mark.slow
def test_the_same_data_are_the_same_archive(cohort: Cohort, tmp_path: Path) -> None:
    settings = ArchiveSettings(license="CC0-1.0", recordings=False)
    made = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        Archive(settings).export(cohort.included, tmp_path / name)
        assert sorted(path.name for path in (tmp_path / name).iterdir()) == [
            "rehearsal.zip", "rehearsal.zip.sha256",
        ]  # fmt: skip
        made.append((tmp_path / name / "rehearsal.zip").read_bytes())
    assert made[0] == made[1]


PERSONAL = (
    "call anna.k@example.org",
    "tel. 0170 1234567",
    "see /home/anna/notes.txt",
    r"in C:\Users\anna\study",
)


@pytest.mark.slow
@pytest.mark.parametrize("planted", PERSONAL)
def test_nothing_is_written_with_anything_personal_in_it(
    planted: str, cohort: Cohort, tmp_path: Path
) -> None:
    """Planted into one text of one participant file, of all that are in it, drawn at random."""
    person = cohort.included[0]
    copy = tmp_path / "data" / person.path.parent.name / person.path.name
    copy.parent.mkdir(parents=True)
    copy.write_bytes(person.path.read_bytes())
    with h5py.File(copy, "r+") as file:
        events = file["ses-01/events/data"]
        rows = events.asstr("utf-8")[:]
        at = random.Random(planted).randrange(1, len(rows))
        rows[at] = json.dumps({**json.loads(rows[at]), "note": planted})
        about = dict(events.attrs)
        del file["ses-01/events/data"]
        encoded = [row.encode() for row in rows]
        made = file.create_dataset("ses-01/events/data", data=encoded)
        made.attrs.update(about)
    (changed,) = find_cohort(tmp_path / "data", ["simulated"]).included
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(ProtocolError, match=r"would contain personal data: recordings/.*events"):
        Archive(ArchiveSettings(license="CC0-1.0")).export([changed], out)
    assert list(out.iterdir()) == []


def test_numbers_of_trials_are_no_telephone_number_and_a_note_of_one_is(tmp_path: Path) -> None:
    file, written = tmp_path / "P001.h5", "5-6 8-9 11-12 14-15"
    for key, found in (
        ("repeats", []),
        ("void", []),
        ("owed", []),
        ("note", ["a telephone number"]),
    ):
        with h5py.File(file, "w") as made:
            made["ses-01/events/data"] = [json.dumps({"trial": 3, key: written}).encode()]
        assert [each.partition(": ")[2] for each in personal_in(file)] == found


@pytest.mark.slow
def test_names_of_computers_are_taken_out_of_the_recordings(
    electrodes: Cohort, tmp_path: Path
) -> None:
    (person,) = electrodes.included
    copy = tmp_path / "data" / "P001" / "P001.h5"
    copy.parent.mkdir(parents=True)
    copy.write_bytes(person.path.read_bytes())
    with h5py.File(copy, "r+") as file:
        header = file["ses-01/streams/BrainAmp/header"][()]
        del file["ses-01/streams/BrainAmp/header"]
        named = header.replace(b"<info>", b"<info><hostname>annas-laptop</hostname>", 1)
        file["ses-01/streams/BrainAmp"].create_dataset("header", data=named)
    assert any("the computer 'annas-laptop'" in found for found in personal_in(copy))
    out = tmp_path / "out"
    out.mkdir()
    changed = find_cohort(tmp_path / "data").included
    Archive(ArchiveSettings(license="CC0-1.0")).export(changed, out)
    (archive,) = out.glob("*.zip")
    with zipfile.ZipFile(archive) as packed:
        given = packed.read("recordings/P001.h5")
    assert b"annas-laptop" not in given
    copy.write_bytes(given)
    (sound,) = find_cohort(tmp_path / "data").included
    assert sound.recording.sessions == [1]
    copy.write_bytes(given.replace(b"-" * 12, b"annas-laptop"))
    with pytest.raises(RecordingError, match="its bytes are not those that were written"):
        open_recording(copy)
    with h5py.File(io.BytesIO(given)) as file:
        hidden = file["ses-01/streams/BrainAmp/header"][()]
    assert hidden == named.replace(b"annas-laptop", b"-" * 12)


@pytest.mark.slow
def test_what_is_no_persons_is_not_taken_for_one(cohort: Cohort, tmp_path: Path) -> None:
    """Seeds, digests, dates and machines have many digits."""
    for person in cohort.included:
        assert list(personal_in(person.path)) == []
    table = tmp_path / "table.csv"
    table.write_text("seed,when,sha\n249278214710071,2026-11-22T15:08:51.123+01:00,"
                     f"{'0123456789abcdef' * 4}\n", encoding="utf-8")  # fmt: skip
    assert list(personal_in(table)) == []
    table.write_text('why\n"{""item"": ""0170 1234567""}"\n', encoding="utf-8")
    assert list(personal_in(table)) == ["line 2 item: a telephone number"]


@pytest.mark.slow
def test_an_archive_without_a_licence_is_refused_in_words(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["--include", "simulated", "--to", "zip", "--out", str(tmp_path / "out")]
    assert main(["export", str(data), *asked]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "zip needs 'license'; write --set NAME=VALUE, where zip has license, authors," in said


@pytest.mark.slow
def test_a_participant_file_says_what_it_is(cohort: Cohort) -> None:
    with h5py.File(cohort.included[0].path) as file:
        readme, cite = (file[name][()].decode() for name in ("README", "CITATION"))
        described = json.loads(file["dataset_description"][()])
        trials = set(file["ses-01/trials"])
    assert "A short study" in readme
    assert described["@context"] == "https://schema.org/"
    assert {each["name"] for each in described["variableMeasured"]} == trials
    assert YAML(typ="safe").load(cite)["version"]
    assert (ROOT / "CITATION.cff").read_text(encoding="utf-8") == citation()
