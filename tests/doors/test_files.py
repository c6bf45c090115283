"""Damaged and hostile recordings: told in words, never followed out of the file, never for all."""

import random
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from doors.fuzz import MOST_BYTES, MOST_S
from results.recorded import record, study

from labcrane import LabcraneError, RecordingError, open_recording
from labcrane.cli.app import main
from labcrane.recording.participant_file.recover import recover
from labcrane.recording.xdf.reader import read_xdf
from labcrane.session.commands import Command, Order


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two good recordings, one without a trial, one without a frame, one without a word."""
    root = tmp_path_factory.mktemp("lab")
    data, the_study = root / "data", study(root)
    record(the_study, data, "P001")
    record(the_study, data, "P002")
    record(the_study, data, "P003", orders={2: [Command(Order.END)]})
    raw = (data / "P001" / "ses-01_run.xdf").read_bytes()
    first = raw.index(b"session.start")
    for name, cut in (("P004", raw.index(b"\x03\x00", raw.index(b"}", first))), ("P005", 1200)):
        (data / name).mkdir()
        (data / name / "ses-01_run.xdf").write_bytes(raw[: max(cut, 1200)])
    recover(data)
    return data


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


def test_a_report_is_of_those_who_can_be_used_and_says_who_cannot(
    lab: Path, tmp_path: Path, capsys
) -> None:
    out = tmp_path / "report"
    assert main(["report", str(lab), "--out", str(out), "--include", "half-finished"]) == 3
    assert "2 recordings cannot be used: P004, P005" in capsys.readouterr().out
    page = (out / "report.html").read_text()
    assert "P004" in page
    assert "holds no frames" in page
    assert (out / "participants" / "P003.html").is_file()


@pytest.mark.parametrize("words", [["export", "--to", "tables"], ["report"]], ids=" ".join)
def test_a_recording_that_breaks_off_in_its_middle_is_left_out_by_itself(
    lab: Path, tmp_path: Path, capsys, words: list[str]
) -> None:
    data = tmp_path / "data"
    for name in ("P001", "P002"):
        shutil.copytree(lab / name, data / name)
    broken = data / "P001" / "P001.h5"
    with h5py.File(broken, "r+") as file:
        del file["ses-01/loop/due"]
    whole = main([*words, str(data), "--out", str(tmp_path / "out")])
    said = " ".join(capsys.readouterr().out.split())
    assert whole == 3, said
    assert "left out: P001, unreadable:" in said
    assert "1 recordings cannot be used: P001" in said


def read_all(path: Path) -> None:
    for session in open_recording(path):
        assert isinstance(session.context, dict)
        _ = session.protocol, session.events, session.trials
        _ = session.questionnaires, session.sync_report, session.attrs
        for stream in session.streams.values():
            _ = stream.time, stream.time_raw, stream.data, stream.units


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


@pytest.mark.parametrize("change", [linked, soft, circle, raw_storage, virtual, bomb])
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


def peak(*, new: bool = True) -> int:
    """Return the most bytes that this process held, since the last call that was ``new``; Linux."""
    if not Path("/proc/self/clear_refs").exists():
        return 0
    if new:
        Path("/proc/self/clear_refs").write_text("5")
    (most,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return 1024 * int(most)


def fuzz(
    raw: bytes, path: Path, read: Callable[[Path], object], count: int, seed: int
) -> dict[str, int]:
    """Read what is damaged at random; a second or 200 MB for one of them is a failure too."""
    dice, found = random.Random(seed), {"read": 0, "refused": 0}
    path.write_bytes(raw)
    read(path)  # libraries are loaded once
    for number in range(count):
        path.write_bytes(damaged(raw, dice))
        before, size = time.process_time(), peak()
        try:
            read(path)
            found["read"] += 1
        except LabcraneError as error:
            assert path.name in str(error)  # noqa: PT017 - some damage is harmless
            found["refused"] += 1
        assert time.process_time() - before < MOST_S, f"damage {number} of seed {seed}"
        assert peak(new=False) - size < MOST_BYTES, f"damage {number} of seed {seed}"
    return found


def test_a_damaged_participant_file_is_read_or_refused_in_words(lab: Path, tmp_path: Path) -> None:
    raw = (lab / "P003" / "P003.h5").read_bytes()
    found = fuzz(raw, tmp_path / "damaged.h5", read_all, 60, seed=1)
    assert min(found.values()) > 5


def test_a_damaged_journal_is_read_or_refused_in_words(lab: Path, tmp_path: Path) -> None:
    raw = (lab / "P003" / "ses-01_run.xdf").read_bytes()
    found = fuzz(raw, tmp_path / "damaged.xdf", read_xdf, 60, seed=2)
    assert found["read"] > 5


@pytest.mark.soak
def test_many_damaged_files(lab: Path, tmp_path: Path) -> None:
    for name in ("P001", "P003"):
        raw = (lab / name / f"{name}.h5").read_bytes()
        fuzz(raw, tmp_path / "damaged.h5", read_all, 10_000, seed=3)
        raw = (lab / name / "ses-01_run.xdf").read_bytes()
        fuzz(raw, tmp_path / "damaged.xdf", read_xdf, 20_000, seed=4)
