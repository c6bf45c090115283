"""What was written is proven equal to what it was made of, before anything is replaced by it."""

import random
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from recording.journals import CONTEXT, write

from labcrane import RecordingError
from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.foreign_streams import read_streams
from labcrane.recording.participant_file import recorrect as recorrect_module
from labcrane.recording.participant_file import relabel as relabel_module
from labcrane.recording.participant_file import writer as writer_module
from labcrane.recording.participant_file.about import ABOUT
from labcrane.recording.participant_file.recorrect import recorrect
from labcrane.recording.participant_file.relabel import relabel_journal, relabel_participant_file
from labcrane.recording.participant_file.writer import consolidate
from labcrane.session.postprocess import conclude

SEEDS = range(25)
COUNT = 200


def foreign(path: Path) -> Path:
    """Write a journal of one stream of numbers and one of texts."""
    numbers = StreamHeader("Gaze", "Gaze", (Channel("x", "px"), Channel("y", "px")), "float32")
    texts = StreamHeader("Keys", "Markers", (Channel("key", ""),), "string")
    with XdfWriter(path) as writer:
        one, other = writer.add_stream(numbers), writer.add_stream(texts)
        times = 1000.0 + np.arange(COUNT) / 100
        gaze = np.random.default_rng(3).normal(size=(COUNT, 2)).astype(np.float32)
        writer.write_samples(one, times, gaze)
        writer.write_texts(other, times[:20].tolist(), [(f"key {k}",) for k in range(20)])
    return path


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A participant with one session in the file, and another beside it."""
    folder = tmp_path_factory.mktemp("prepared") / "P001"
    folder.mkdir()
    first = [write(folder / "ses-01_run.xdf", COUNT), foreign(folder / "ses-01_streams.xdf")]
    consolidate(folder / "P001.h5", first, conclude)
    write(folder / "ses-02_run.xdf", COUNT, context={**CONTEXT, "session": 2})
    foreign(folder / "ses-02_streams.xdf")
    return folder


@pytest.fixture
def folder(prepared: Path, tmp_path: Path) -> Path:
    """Copy them, for one test."""
    return shutil.copytree(prepared, tmp_path / "P001")


def another(old: object) -> object:
    """Return the nearest value to an old one that is not the same, or another text."""
    if isinstance(old, str):
        return f"{old}x"
    if isinstance(old, bytes):
        return (old or b" ")[:-1] + (b"~" if not old.endswith(b"~") else b"-")
    if isinstance(old, np.floating):
        return type(old)(0.0) if np.isnan(old) else np.nextafter(old, type(old)(np.inf))
    return old + 1 if isinstance(old, np.integer) else not old


def changed_somewhere(path: Path, dice: random.Random, session: str, leave: str) -> str:
    """Change one value, text or attribute of a session, or remove a node; return which."""
    with h5py.File(path, "r+") as file:
        nodes: list[str] = []
        file[session].visititems(lambda name, _: nodes.append(name))
        name = dice.choice([one for one in nodes if not re.search(leave, one)])
        node = file[session][name]
        marks = sorted(node.attrs)
        what = dice.choice(["value", "value", "remove", "mark"])
        if what == "mark" and marks:
            mark = dice.choice(marks)
            node.attrs[mark] = another(node.attrs[mark])
        elif what == "value" and isinstance(node, h5py.Dataset) and node.size:
            if node.shape == ():
                node[()] = bytes([node[()][0] ^ 1]) + node[()][1:]
            else:
                at = dice.randrange(len(node))
                node[at] = another(node[at])
        else:
            del file[session][name]
        return f"{session}/{name}"


TIMES = r"sync_report|streams/.*/(time$|time_error|time_uneven|time_basis|earlier)"


@pytest.mark.parametrize("session", ["ses-01", "ses-02"])
@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_a_disk_changes_in_a_new_file_keeps_the_old_one_in_its_place(
    folder: Path, monkeypatch: pytest.MonkeyPatch, seed: int, session: str
) -> None:
    dice, path = random.Random(seed), folder / "P001.h5"
    before, really = path.read_bytes(), writer_module._write
    # The times of a new session are worked out from it, and nothing is lost with them.
    leave = TIMES if session == "ses-02" else "^$"
    marked = []

    def badly(beside: Path, *rest: object) -> None:
        really(beside, *rest)
        marked.append(changed_somewhere(beside, dice, session, leave))

    monkeypatch.setattr(writer_module, "_write", badly)
    journals = [folder / "ses-02_run.xdf", folder / "ses-02_streams.xdf"]
    with pytest.raises(RecordingError, match=r"is unchanged: check the disk|it is as it was"):
        consolidate(path, journals, conclude)
    assert path.read_bytes() == before, marked
    assert sorted(each.name for each in folder.iterdir() if each.name.startswith(".P001")) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_changes_while_clocks_are_corrected_keeps_the_old_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    dice, path = random.Random(seed), folder / "P001.h5"
    before, really = path.read_bytes(), recorrect_module.bring_to_disk

    def badly(beside: Path) -> None:
        changed_somewhere(beside, dice, "ses-01", TIMES)
        really(beside)

    monkeypatch.setattr(recorrect_module, "bring_to_disk", badly)
    with pytest.raises(RecordingError, match="was not copied unchanged"):
        recorrect(path, conclude)
    assert path.read_bytes() == before


@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_changes_while_a_file_is_relabelled_is_noticed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    dice, path = random.Random(seed), folder / "P001.h5"
    before, really = path.read_bytes(), relabel_module.bring_to_disk

    def badly(target: Path) -> None:
        changed_somewhere(target, dice, "ses-01", r"context|^journals/size|^journals$")
        really(target)

    monkeypatch.setattr(relabel_module, "bring_to_disk", badly)
    with pytest.raises(RecordingError, match="check the disk"):
        relabel_participant_file(path, tmp_path / "P002.h5", "P001", "P002", {})
    assert path.read_bytes() == before


@pytest.mark.parametrize("kind", ["run", "streams"])
@pytest.mark.parametrize("seed", range(10))
def test_a_text_that_changes_while_a_journal_is_relabelled_is_noticed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, kind: str
) -> None:
    dice, really = random.Random(seed), XdfWriter.write_texts

    def badly(self: XdfWriter, number: int, times: list[float], rows: list) -> None:
        row = dice.randrange(len(rows))
        rows[row] = (rows[row][0][:-1] + "~",)
        really(self, number, times, rows)

    monkeypatch.setattr(XdfWriter, "write_texts", badly)
    with pytest.raises(RecordingError, match="does not read as"):
        relabel_journal(folder / f"ses-01_{kind}.xdf", tmp_path / "new.xdf", "P001", "P002")


def test_a_stream_whose_serial_number_names_the_participant_is_relabelled(tmp_path: Path) -> None:
    """As those of estimates, whose serial number is the session's."""
    serial = "<acquisition><serial_number>a study/P001/ses-01</serial_number></acquisition>"
    text = StreamHeader("Load", "Estimate", (Channel("ratio", ""),), "double64").xml
    assert "<desc>" in text
    header = StreamHeader.from_xml(text.replace("<desc>", f"<desc>{serial}"))
    with XdfWriter(tmp_path / "old.xdf") as writer:
        writer.write_sample(writer.add_stream(header), 1.0, np.array([2.0]))
    relabel_journal(tmp_path / "old.xdf", tmp_path / "new.xdf", "P001", "P002")
    (stream,) = read_streams([tmp_path / "new.xdf"])[0]
    assert "a study/P002/ses-01" in str(stream.header.text)
    assert "P001" not in str(stream.header.text)


@pytest.mark.slow
def test_what_is_as_it_was_is_accepted(folder: Path, tmp_path: Path) -> None:
    path = folder / "P001.h5"
    journals = [folder / "ses-02_run.xdf", folder / "ses-02_streams.xdf"]
    consolidate(path, journals, conclude)
    recorrect(path, conclude)
    recorrect(path, lambda group: None)
    for each in (1, 2):
        for kind in ("run", "streams"):
            journal = folder / f"ses-0{each}_{kind}.xdf"
            relabel_journal(journal, tmp_path / journal.name, "P001", "P002")
    relabel_participant_file(path, tmp_path / "P002.h5", "P001", "P002", {})
    assert len(read_streams([folder / "ses-02_streams.xdf"])[0]) == 2
    with h5py.File(tmp_path / "P002.h5") as file:
        assert set(file) == {"ses-01", "ses-02", *ABOUT}
