"""Damaged and hostile recordings: told in words, never followed out of the file, never for all."""

import hashlib
import random
import re
import shutil
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from doors.fuzz import BUSY_S, MOST_BYTES, MOST_S
from results.recorded import record, study

from labcrane import LabcraneError, RecordingError, open_recording
from labcrane.recording.participant_file.containment import DEEPEST
from labcrane.recording.participant_file.recover import recover
from labcrane.recording.xdf.reader import XdfFile, read_xdf
from labcrane.testing import Command, Order, main

SEAL_BYTES = 32


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good recordings, one without a trial, one without a frame, one without a word."""
    root = tmp_path_factory.mktemp("lab")
    data, chosen = root / "data", study(root)
    record(chosen, data, "P001")
    record(chosen, data, "P002")
    record(chosen, data, "P003", orders={2: [Command(Order.END)]})
    raw = (data / "P001" / "ses-01_run.xdf").read_bytes()
    first = raw.index(b"session.start")
    for name, cut in (("P004", raw.index(b"\x03\x00", raw.index(b"}", first))), ("P005", 1200)):
        (data / name).mkdir()
        (data / name / "ses-01_run.xdf").write_bytes(raw[: max(cut, 1200)])
    recover(data)
    return data


@pytest.mark.slow
@pytest.mark.parametrize("to", ["tables", "matlab", "bids", "psychds", "xdf"])
def test_a_recording_without_frames_is_named_left_out_and_the_rest_is_exported(
    lab: Path, tmp_path: Path, capsys, to: str
) -> None:
    out = tmp_path / "out"
    words = ["export", str(lab), "--to", to, "--out", str(out), "--include", "half-finished"]
    assert main(words) == 3
    said = " ".join(capsys.readouterr().out.split())
    assert "left out: P004, unreadable: session 1" in said
    assert "left out: P005, unreadable: session 1" in said
    assert "2 recordings cannot be used: P004, P005" in said
    assert any(path.is_file() for path in out.rglob("*"))


def read_all(path: Path) -> str:
    """Return everything that a participant file holds, as a sum of it."""
    recording = open_recording(path)
    found: list[object] = [recording.participant, recording.attrs, recording.sessions]
    for session in recording:
        assert isinstance(session.context, dict)
        tables = [session.events, session.trials, session.questionnaires]
        found += [session.context, session.protocol, session.sync_report, session.attrs]
        for stream in session.streams.values():
            found += [stream.name, stream.attrs, stream.units]
            found += [np.asarray(each).tobytes() for each in (stream.time, stream.time_raw)]
            tables.append(stream.data)
        for name, values in (pair for each in tables for pair in each.items()):
            plain = values.to_numpy()
            found += [name, repr(list(plain)) if plain.dtype == object else plain.tobytes()]
    return hashlib.sha256(repr(found).encode()).hexdigest()


def linked(file: h5py.File, outside: Path) -> None:
    file["ses-01/other"] = h5py.ExternalLink(str(outside), "/secret")


def soft(file: h5py.File, outside: Path) -> None:
    file["ses-01/other"] = h5py.SoftLink("/ses-01/loop")


def circle(file: h5py.File, outside: Path) -> None:
    file["ses-01/state/again"] = file["ses-01"]


def raw_storage(file: h5py.File, outside: Path) -> None:
    made = file.create_dataset("ses-01/state/secret", (8,), "f8", external=[(str(outside), 0, 64)])
    made.attrs["unit"], made.attrs["position"] = "1", 99.0


def virtual(file: h5py.File, outside: Path) -> None:
    layout = h5py.VirtualLayout((8,), "f8")
    layout[:] = h5py.VirtualSource(str(outside), "secret", (8,))
    file.create_virtual_dataset("ses-01/state/secret", layout)


def bomb(file: h5py.File, outside: Path) -> None:
    file.create_dataset("ses-01/state/secret", (4_000_000,), "f8", chunks=(1000,))


def large_piece(file: h5py.File, outside: Path) -> None:
    """Four million numbers in a piece for nine, which is unpacked whole for each of them."""
    made = file.create_dataset(
        "ses-01/state/secret",
        (4_000_000,),
        "f8",
        maxshape=(None,),
        chunks=(9_000_000,),
        compression="gzip",
    )
    made[:] = np.arange(4_000_000) % 100
    made.attrs["unit"], made.attrs["position"] = "1", 99.0


def deep(file: h5py.File, outside: Path) -> None:
    node = file["ses-01"]
    for _ in range(600):  # each by itself: of 3,000 the way to each takes HDF5 the better part of
        node = node.create_group("a")  # a minute, and what is too deep is too deep at 33


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [linked, soft, circle, raw_storage, virtual, bomb, large_piece, deep]
)
def test_nothing_is_followed_out_of_a_participant_file_nor_kept_by_recover(
    lab: Path, tmp_path: Path, change: Callable[[h5py.File, Path], None]
) -> None:
    folder = tmp_path / "P001"
    shutil.copytree(lab / "P001", folder)
    outside = tmp_path / "outside.h5"
    with h5py.File(outside, "w") as file:
        file["secret"] = np.arange(8.0)
    path = folder / "P001.h5"
    with h5py.File(path, "r+") as file:
        change(file, outside)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="is not as labcrane writes it: /ses-01"):
        read_all(path)
    (folder / "ses-01_run.xdf").rename(folder / "ses-02_run.xdf")
    [recovery] = recover(tmp_path)
    assert "is not as labcrane writes it" in recovery.problem
    assert path.read_bytes() == before


def damaged(raw: bytes, dice: random.Random) -> bytes:
    changed = bytearray(raw)
    for _ in range(dice.choice([1, 1, 2, 5, 20])):
        at = dice.randrange(min(len(changed), 60_000) if dice.random() < 0.7 else len(changed))
        match dice.randrange(4):
            case 0:
                changed[at] = dice.randrange(256)
            case 1:
                changed[at : at + 8] = dice.randbytes(8)
            case 2:
                changed[at : at + 64] = bytes(64)
            case _:
                changed = changed[: max(1000, at)] if dice.random() < 0.2 else changed
    return bytes(changed)


@pytest.mark.slow
def test_a_changed_number_of_a_short_column_is_found_though_hdf5_does_not_see_it(
    lab: Path, tmp_path: Path
) -> None:
    path = tmp_path / "P001.h5"
    raw = bytearray((lab / "P001" / "P001.h5").read_bytes())
    with h5py.File(lab / "P001" / "P001.h5") as file:
        column = file["ses-01/trials/trial"]
        held, at = column[:], column.id.get_offset()
    raw[at + 6] ^= 1
    path.write_bytes(raw)
    with h5py.File(path) as file:
        assert (file["ses-01/trials/trial"][:] != held).any()
    with pytest.raises(RecordingError, match="its bytes are not those that were written"):
        open_recording(path)
    path.write_bytes(raw[:-SEAL_BYTES])  # as files of before are
    assert open_recording(path).sessions == [1]


@pytest.mark.slow
def test_a_file_that_was_changed_with_hdf5_has_no_seal_and_is_read(
    lab: Path, tmp_path: Path
) -> None:
    path = tmp_path / "P001.h5"
    shutil.copy(lab / "P001" / "P001.h5", path)
    with h5py.File(path, "r+") as file:
        file["ses-01/trials/trial"][0] = 7.0
    (session,) = open_recording(path)
    assert session.trials["trial"][0] == 7.0


def add_something(node: h5py.Group, dice: random.Random) -> None:
    """Add a column or an attribute of any type, as people do who work with h5py."""
    words = ["é" * dice.randrange(200) for _ in range(dice.randrange(1, 40))]
    value: object = dice.choice(
        [words, [word.encode() for word in words], words[0], words[0].encode(), 1.5, True,
         np.frombuffer(dice.randbytes(800), np.uint8), np.arange(100.0), np.array(words, "O")]
    )  # fmt: skip
    name = f"mine {dice.randrange(2**40)}"
    if dice.random() < 0.5:
        node.attrs[name] = value
    elif isinstance(value, list | np.ndarray) and dice.random() < 0.5:
        kind = h5py.string_dtype() if len({type(one) for one in value} & {str, bytes}) else None
        node.create_dataset(name, data=value, compression="gzip", chunks=True, dtype=kind)
    else:
        node[name] = value


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_a_file_to_which_others_added_anything_is_read(
    lab: Path, tmp_path: Path, seed: int
) -> None:
    dice, path = random.Random(seed), tmp_path / "P001.h5"
    shutil.copy(lab / "P001" / "P001.h5", path)
    held = open_recording(path).session(1).events["name"].tolist()
    with h5py.File(path, "r+") as file:
        for _ in range(30):
            add_something(file.require_group("mine"), dice)
    assert open_recording(path).session(1).events["name"].tolist() == held


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_attributes_that_others_gave_to_any_node_are_returned_and_hide_nothing(
    lab: Path, tmp_path: Path, seed: int
) -> None:
    dice, path = random.Random(seed), tmp_path / "P001.h5"
    shutil.copy(lab / "P001" / "P001.h5", path)
    held = open_recording(path).session(1)
    with h5py.File(path, "r+") as file:
        for name in ("/", "ses-01", "ses-01/trials/trial"):
            file[name].attrs["of others"] = dice.choice(
                [np.arange(3.0), b"bytes", ["one", "two"], 7, True, "text", h5py.Empty("f8")]
            )
        added = file["ses-01"].attrs["of others"]
    recording = open_recording(path)
    session = recording.session(1)
    assert np.array_equal(session.attrs["of others"], added)
    assert "of others" in recording.attrs
    assert session.events.equals(held.events)
    assert session.trials.equals(held.trials)
    assert {**session.attrs, "of others": None} == {**held.attrs, "of others": None}


@pytest.mark.slow
def test_a_text_that_says_it_is_longer_than_any_is_refused_before_memory_is_taken_for_it(
    lab: Path, tmp_path: Path
) -> None:
    raw = bytearray((lab / "P001" / "P001.h5").read_bytes()[:-SEAL_BYTES])
    begin = raw.index(b"\x19\x01\x01\x00\x10\0\0\0", raw.index(b"participant\0"))
    raw[begin + 32 : begin + 36] = (2**31 - 1).to_bytes(4, "little")
    path = tmp_path / "P001.h5"
    path.write_bytes(raw)
    before = peak()
    with pytest.raises(RecordingError, match=r"the text at byte \d+ says it is 2147483647 bytes"):
        open_recording(path)
    assert peak(new=False) - before < 50_000_000


def peak(*, new: bool = True) -> int:
    """Return the most bytes that this process held, since the last call that was ``new``; Linux."""
    if not Path("/proc/self/clear_refs").exists():
        return 0
    if new:
        Path("/proc/self/clear_refs").write_text("5")
    (most,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return 1024 * int(most)


Samples = dict[str, Counter[tuple[bytes, object]]]
"""Of each stream, how often each stamp is there with each value."""


def samples_of(file: XdfFile) -> Samples:
    found: Samples = {}
    for stream in file.streams:
        values = list(stream.texts) or [row.tobytes() for row in stream.data]
        stamps = [stamp.tobytes() for stamp in stream.stamps]
        found.setdefault(stream.header.name, Counter()).update(zip(stamps, values, strict=True))
    return found


class ReadJournal:
    """Reads damaged journals: what is read is what was written, or is said to be unverified."""

    def __init__(self, good: Path) -> None:
        file = read_xdf(good)
        assert file.whole
        assert file.checked == good.stat().st_size
        self._good = samples_of(file)
        self.less = 0

    def __call__(self, path: Path) -> bool:
        """Return whether all that was read, and can be told to be unlike, is as it was written."""
        file = read_xdf(path)
        if file.unchecked or file.checked < path.stat().st_size - file.torn:
            return True  # said
        found = samples_of(file)
        missing = sum(
            (self._good[name] - found.get(name, Counter())).total() for name in self._good
        )
        self.less += bool(missing)
        assert not missing or not file.whole, "samples are missing, and the file is whole"
        return found.keys() <= self._good.keys() and all(
            counts <= self._good[name] for name, counts in found.items()
        )


class ReadRecording:
    """Reads damaged participant files: all of one is as it was written, or it is refused."""

    def __init__(self, good: Path) -> None:
        self._good = read_all(good)

    def __call__(self, path: Path) -> bool:
        return read_all(path) == self._good


def fuzz(
    raw: bytes,
    path: Path,
    read: Callable[[Path], bool],
    count: int,
    seed: int,
    most_s: float = BUSY_S,
) -> dict[str, int]:
    """Read what is damaged at random; longer or 200 MB more for one of them is a failure too."""
    dice, found = random.Random(seed), {"read": 0, "refused": 0}
    for number in range(count):
        path.write_bytes(damaged(raw, dice))
        before, size = time.thread_time(), peak()
        try:
            assert read(path), f"damage {number} of seed {seed}"
            found["read"] += 1
        except LabcraneError as error:
            assert path.name in str(error)  # noqa: PT017 - some damage is harmless
            found["refused"] += 1
        assert time.thread_time() - before < most_s, f"damage {number} of seed {seed}"
        assert peak(new=False) - size < MOST_BYTES, f"damage {number} of seed {seed}"
    return found


@pytest.mark.slow
def test_a_damaged_participant_file_is_read_as_written_or_refused_in_words(
    lab: Path, tmp_path: Path
) -> None:
    good = lab / "P003" / "P003.h5"
    read = ReadRecording(good)
    assert read(good)
    found = fuzz(good.read_bytes(), tmp_path / "damaged.h5", read, 60, seed=1)
    assert found["refused"] > 30  # some draws change nothing; how many is chance


@pytest.mark.slow
def test_a_damaged_journal_is_read_as_written_or_said_not_to_be(lab: Path, tmp_path: Path) -> None:
    good = lab / "P003" / "ses-01_run.xdf"
    read = ReadJournal(good)
    found = fuzz(good.read_bytes(), tmp_path / "damaged.xdf", read, 60, seed=2)
    assert found["read"] > 5
    assert read.less > 5


@pytest.mark.soak
@pytest.mark.parametrize("name", ["P001", "P003"])
def test_many_damaged_files(lab: Path, tmp_path: Path, name: str) -> None:
    good = lab / name / f"{name}.h5"
    fuzz(
        good.read_bytes(), tmp_path / "damaged.h5", ReadRecording(good), 750, int(name[1:]), MOST_S
    )
    good = lab / name / "ses-01_run.xdf"
    raw, seed = good.read_bytes(), 10 + int(name[1:])
    fuzz(raw, tmp_path / "damaged.xdf", ReadJournal(good), 750, seed, MOST_S)


@pytest.mark.slow
@pytest.mark.parametrize("named", [3, np.arange(4), h5py.Empty("S1"), np.bytes_(b"P001")], ids=repr)
def test_a_participant_that_is_no_text_is_refused(lab: Path, tmp_path: Path, named: object) -> None:
    path = tmp_path / "P001.h5"
    path.write_bytes((lab / "P001" / "P001.h5").read_bytes()[:-SEAL_BYTES])
    with h5py.File(path, "r+") as file:
        file.attrs["participant"] = named
    with pytest.raises(RecordingError, match=r"its participant is .*, no text"):
        open_recording(path)


@pytest.mark.slow
def test_of_groups_nested_without_end_only_the_first_are_visited(
    lab: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The way to a group costs as much as it is long: 3,000 of them took a minute."""
    path = tmp_path / "P001.h5"
    path.write_bytes((lab / "P001" / "P001.h5").read_bytes()[:-SEAL_BYTES])
    with h5py.File(path, "r+") as file:
        deep(file, path)
        usual = sum(name.count("/") < DEEPEST for name in names_in(file))
    visited: list[str] = []
    visit = h5py.Group.visititems

    def counted(self: h5py.Group, look: Callable[[str, object], object]) -> object:
        return visit(self, lambda name, node: [visited.append(name), look(name, node)][1])

    monkeypatch.setattr(h5py.Group, "visititems", counted)
    with pytest.raises(RecordingError, match="nested deeper than labcrane writes them"):
        open_recording(path)
    assert 0 < len(visited) <= usual + 2


def names_in(file: h5py.File) -> list[str]:
    names: list[str] = []
    file.visit(names.append)
    return names
