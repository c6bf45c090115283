"""Names of participants, studies and streams: what passes at the door can be handled everywhere."""

import random
import re
import stat
import unicodedata
from io import StringIO
from pathlib import Path

import pandas as pd
import pytest
from governance.kept_people import REASON, store_of
from governed import TODAY, Lab
from hypothesis import example, given, settings
from hypothesis import strategies as st
from needs import needs
from programs import ran
from rehearsal import SHORT, a_study

from labcrane import ProtocolError, RecordingError
from labcrane.core import file_name_of
from labcrane.files.names import DEVICES, LONGEST, OURS, check_name, misfit, twin_key
from labcrane.participants import recovery
from labcrane.participants.copies import inventory
from labcrane.participants.enrolment import check_apart
from labcrane.participants.erasure import mentions
from labcrane.participants.folders import Places, keep_private
from labcrane.participants.mentions import Mentions
from labcrane.participants.register import Entry, Register, read

LIKELY = st.text("PVp-_01a9", min_size=1, max_size=8)
ANY = st.text(min_size=0, max_size=60)


@given(ANY | LIKELY)
@example("register")
@example("CON")
@example("Exports")
@example("P001 ")
@example("P001.")
@example("..")
@example("P001/../P002")
@example("P001-PILOT")
@example("P001-simulated")
@example("P\u0660\u0660\u0661")  # Arabic digits, which \d matches
@example("\uff30001")  # a full-width P
@example("P001\n")
def test_a_name_that_passes_is_one_folder_of_its_own_on_every_disk(name: str) -> None:
    if misfit(name) is not None:
        with pytest.raises(
            ProtocolError, match=r"(?s)^participant .+; (use|give|remove|take|leave) "
        ):
            check_name(name, "participant")
        return
    assert check_name(name, "participant") == name
    assert Path(name).name == name
    assert not name.startswith((".", "-", "~"))
    assert name == unicodedata.normalize("NFC", name) == unicodedata.normalize("NFKD", name)
    assert name.isascii()
    assert len(name) <= LONGEST
    assert not set(name) & set('<>:"/\\|?*. \t\r\n\0$')
    low = name.casefold()
    assert low not in {"con", "prn", "aux", "nul", "com1", "lpt9"} | DEVICES
    assert low not in {"register", "exports"} | OURS
    assert not low.endswith(("-pilot", "-simulated"))


@pytest.mark.parametrize("name", ["NA", "na", "T", "F", "t", "Inf", "inf"])
def test_a_name_that_a_table_does_not_hold_as_text_is_refused(name: str) -> None:
    with pytest.raises(ProtocolError, match="is read by R or pandas as a missing value, a truth"):
        check_name(name, "participant")


@settings(max_examples=300)
@given(st.lists(st.from_regex(r"\A[0-9]{1,4}(E[0-9]{1,2})?\Z"), min_size=2, max_size=6))
@example(["001", "01", "1"])
@example(["1E05", "1E5", "100000"])
def test_of_names_that_pandas_reads_as_one_number_one_is_let_in(names: list[str]) -> None:
    text = "\n".join(["participant", *admitted(names)])
    assert pd.read_csv(StringIO(text))["participant"].is_unique


@needs("Rscript")
def test_of_names_that_r_reads_as_one_number_one_is_let_in() -> None:
    dice = random.Random()
    forms = (hex, str, "0{:x}".format, "0X{:X}".format, "0{}i".format, "{}e".format)
    names = [dice.choice(forms)(dice.randrange(60)) for _ in range(100)]
    people = admitted([*names, "0x10", "16", "016", "0X10", "16e", "16i", "016i"])
    # Each in a column of its own, so that R takes it for a number where it can.
    alone = ", ".join(f'read.csv(text = "p\\n{name}")$p' for name in people)
    asked = f'cat(sapply(list({alone}), as.character), sep = "\\n")'
    done = ran(["Rscript", "-e", asked], check=True)
    values = done.stdout.split()
    assert len(values) == len(people)
    assert len(set(values)) == len(values)


@given(ANY)
def test_every_text_has_a_file_name_of_its_own(text: str) -> None:
    name = file_name_of(text)
    assert re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", name)
    assert len(name) <= LONGEST + 9
    assert not name.endswith(".")
    assert name.lower().split(".")[0] not in DEVICES
    if name != text:  # what has been changed carries a mark, so that no two become one
        assert file_name_of(text + "'") != name


def registered(*names: str) -> Register:
    entry = Entry(slot=1, seed=1, enrolled="2026-01-01", holds_slot=False)
    return Register(participants=dict.fromkeys(names, entry))


def admitted(names: list[str]) -> list[str]:
    """Return those who would be let in, one after the other."""
    let_in: list[str] = []
    for name in names:
        try:
            check_apart(registered(*let_in), name)
        except ProtocolError:
            continue
        if name not in let_in:
            let_in.append(name)
    return let_in


@settings(max_examples=300)
@given(st.lists(LIKELY, min_size=2, max_size=6), st.data())
def test_a_text_about_one_person_never_mentions_another(
    names: list[str], data: st.DataObject
) -> None:
    people = admitted(names)
    for name in people:
        bare = re.sub("[^A-Za-z0-9]", "", name)
        for text in (
            name, f"{name}-PILOT", f"{name}_ses-01_frames.csv.gz", f"sub-{bare}/ses-01",
            f"sub-{bare}_task-crane", f"labcrane/study/{name}/ses-01", f'{{"is": "{name}"}}',
            f"study-x_subject-{bare}_session-1_data.csv", f"{bare}SIMULATED",
        ):  # fmt: skip
            assert Mentions(people).of(text) == {name}, text
    assert len({twin_key(name) for name in people}) == len(people)


@settings(max_examples=300)
@given(
    st.lists(
        st.one_of(LIKELY, st.sampled_from(["P1-P1", "P1", "1", "01"])), min_size=1, max_size=4
    ),
    st.text("P01-_/. subÜ", max_size=30),
)
def test_searching_for_letters_first_finds_what_trying_at_every_sign_finds(
    names: list[str], text: str
) -> None:
    named = Mentions(names)
    for whole in (text, *(f"{text}{name}{text}sub-{name}" for name in names)):
        tried = [(one.start(), one[0]) for one in named._pattern.finditer(whole)]
        for start, stop in ((0, len(whole)), (3, len(whole) - 4)):
            inside = [word for at, word in tried if start <= at < stop]
            assert named.of(whole, start, stop) == {named._owners[word] for word in inside}


@given(LIKELY, LIKELY, st.text("P01-_/. ", max_size=30))
def test_renaming_is_undone_by_renaming_back(old: str, new: str, text: str) -> None:
    people = admitted([old, new])
    bare = re.sub("[^A-Za-z0-9]", "", old)
    if len(people) < 2 or Mentions([new]).of(text) or (bare != old and bare in text):
        return  # what BIDS calls somebody stands behind sub-
    named = Mentions(people)
    assert named.renamed(named.renamed(text, old, new), new, old) == text


@pytest.mark.parametrize(
    ("old", "new", "bids"),
    [("P007", "VP-007", "VP007"), ("VP-007", "P007", "P007"), ("P007", "P008", "P008")],
)
def test_a_new_name_is_spelled_as_the_old_one_was(old: str, new: str, bids: str) -> None:
    was = old.replace("-", "")
    text = f'{old}/ses-01, "{old}", sub-{was}/sub-{was}_eeg, subject-{was}_x, {was}PILOT, P0071'
    assert Mentions([old, new]).renamed(text, old, new) == (
        f'{new}/ses-01, "{new}", sub-{bids}/sub-{bids}_eeg, subject-{bids}_x, {bids}PILOT, P0071'
    )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("p001", "p001 could be taken for P001, who is in the register"),
        ("P-001", "P-001 could be taken for P001"),
        ("P001-2", "P001-2 could be taken for P001"),
        ("001", "'001' cannot be distinguished from an ordinary"),
        ("lpt1", "'lpt1' is a device name on Windows; use another name"),
        ("Register", "'Register' is reserved for labcrane's own files"),
        ("P001-PILOT", "ends in -PILOT, which labcrane adds itself"),
        ("P" * 41, "has 41 characters; take 40 at most"),
        ("P001.", "cannot be the name of a folder everywhere"),
    ],
)
def test_a_pseudonym_that_could_be_mistaken_is_refused_in_words(name: str, said: str) -> None:
    with pytest.raises(ProtocolError, match=re.escape(said)):
        check_apart(registered("P001"), name)


@pytest.mark.parametrize("word", ["register", "exports", "..", "P007-PILOT", "", "P007/../P001"])
def test_words_that_are_no_participants_are_not_erased(lab: Lab, word: str) -> None:
    before = {path: path.read_bytes() for path in lab.places.files() if path.suffix != ".lock"}
    with pytest.raises(ProtocolError):
        recovery.erase(lab.places, word, REASON, TODAY)
    with pytest.raises(ProtocolError):
        recovery.correct(lab.places, "P007", word, "typed wrongly", TODAY)
    after = {path: path.read_bytes() for path in lab.places.files() if path.suffix != ".lock"}
    assert after == before


@pytest.mark.parametrize("study", ["con", "a-", "study_", "x" * 41])
def test_a_study_that_cannot_be_a_folder_is_refused(tmp_path: Path, study: str) -> None:
    with pytest.raises(ProtocolError, match=rf"study: .*{study}"):
        a_study(tmp_path, SHORT.replace("study: rehearsal", f"study: {study}"))


def test_a_stream_whose_name_leaves_the_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match="cannot be the name of a folder everywhere"):
        a_study(tmp_path, f"{SHORT}streams: {{'../eeg': {{name: EEG}}}}\n")


@pytest.mark.slow
def test_somebody_recorded_under_a_name_that_is_refused_today_can_be_erased(lab: Lab) -> None:
    from labcrane.participants.register import changed

    old = "Ü07"
    lab.places.raw("P007").rename(lab.places.raw(old))
    with changed(lab.places) as register:
        register.participants[old] = register.participants.pop("P007")
    recovery.erase(lab.places, old, REASON, TODAY)
    assert not lab.places.raw(old).exists()
    assert old not in read(lab.places).participants


def test_a_folder_that_differs_in_capitals_only_is_refused(lab: Lab) -> None:
    visit = lab.visit("P001", pilot=True)
    (lab.places.root / "p001-pilot").mkdir()
    with pytest.raises(ProtocolError, match=r"P001-PILOT and p001-pilot, who is here already"):
        visit.folder.make()


def outside(lab: Lab) -> Path:
    folder = lab.folder / "outside"
    folder.mkdir()
    (folder / "P007.txt").write_text("P007", encoding="utf-8")
    (folder / "P007.txt").chmod(0o644)
    folder.chmod(0o755)
    return folder


@needs("permissions")
def test_permissions_behind_links_stay_and_dangling_ones_do_not_matter(lab: Lab) -> None:
    folder = outside(lab)
    raw = lab.places.raw("P007")
    (raw / "link").symlink_to(folder)
    (raw / "file").symlink_to(folder / "P007.txt")
    (raw / "dangling").symlink_to(folder / "gone")
    keep_private(raw)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o755
    assert stat.S_IMODE((folder / "P007.txt").stat().st_mode) == 0o644
    assert stat.S_IMODE((raw / "P007.h5").stat().st_mode) == 0o600


@pytest.mark.slow
@needs("links")
def test_erasing_removes_links_and_never_what_is_behind_them(lab: Lab) -> None:
    folder = outside(lab)
    raw = lab.places.raw("P007")
    (raw / "link").symlink_to(folder)
    (raw / "dangling").symlink_to(folder / "gone")
    (lab.places.root / "loop").symlink_to(lab.places.root)
    recovery.erase(lab.places, "P007", REASON, TODAY)
    assert not raw.exists()
    assert (folder / "P007.txt").read_text(encoding="utf-8") == "P007"
    assert mentions(lab.places, "P007") == ([], [])


@needs("links")
def test_a_link_in_the_place_of_a_recording_is_told_and_due_until_it_is_gone(lab: Lab) -> None:
    raw = lab.places.raw("P007")
    moved = lab.folder / "P007 moved"
    raw.rename(moved)
    raw.symlink_to(moved)
    before = sorted(moved.iterdir())
    done = recovery.erase(lab.places, "P007", REASON, TODAY)
    assert [(owed.folder, owed.link) for owed in done.reach.owed] == [(str(raw), True)]
    assert sorted(moved.iterdir()) == before
    assert raw.is_symlink()
    recovery.move(lab.places, store_of(lab))
    assert [each.what for each in inventory(lab.places, "P007")].count("owed") == 1
    raw.unlink()
    recovery.move(lab.places, store_of(lab))
    assert read(lab.places).owed == []


@needs("links")
def test_no_session_is_recorded_behind_a_link(tmp_path: Path) -> None:
    study = a_study(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "P001").symlink_to(tmp_path / "elsewhere")
    from labcrane.recording.data_folder import DataFolder

    assert study.protocol.study == "rehearsal"
    with pytest.raises(RecordingError, match="is a link, and links are never followed"):
        DataFolder(tmp_path, "P001", pilot=False, simulated=False).make()


@needs("links")
def test_transfer_follows_no_links(lab: Lab) -> None:
    (lab.places.raw("P001") / "notes.txt").symlink_to(outside(lab) / "P007.txt")
    done = recovery.move(lab.places, store_of(lab))
    assert "P001/notes.txt: a link, which is not followed" in done.only_here
    assert not (store_of(lab) / "rehearsal" / "P001" / "notes.txt").exists()
    assert Places(lab.places.root).raw("P001").is_dir()
