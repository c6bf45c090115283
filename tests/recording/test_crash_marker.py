"""Crash markers that a disk or somebody has spoilt: said to be so, and nothing else comes of it."""

import json
import os
import random
import struct
from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import pytest
from needs import need, needs
from rehearsal import ScriptedConsole
from results.recorded import study

from labcrane import RecordingError, open_recording
from labcrane.files.lock import exclusive, held
from labcrane.launcher.hang_detector import HANG_S, HangDetector
from labcrane.processes import watch_clock
from labcrane.recording.crash_marker import (
    MOST_BYTES,
    SHIFT,
    CrashMarker,
    CrashMarkerFile,
    Place,
    read_crash_marker,
    read_number,
)
from labcrane.testing import Command, Order, Visit, main, run

PLACE = Place("dynamics 'bullet_crane'", "bullet", "step", "bullet_crane.py:12")
GOOD = json.dumps([asdict(PLACE)]).encode()


def number(tick: int, place: int) -> bytes:
    return struct.pack("=q", ((tick + 1) << SHIFT) + place)


def folder(path: Path) -> None:
    (path / "inside").mkdir(parents=True)
    (path / "inside" / "kept").write_text("kept")


def link(path: Path) -> None:
    need("links")
    path.symlink_to(path.parents[2] / "thesis.txt")


def pipe(path: Path) -> None:
    need("named pipes")
    os.mkfifo(path)


def content(raw: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(raw) and None


def text(**changed: object) -> bytes:
    return number(3, 1) + json.dumps([asdict(PLACE) | changed]).encode()


SPOILT: dict[str, Callable[[Path], None]] = {
    "empty": content(b""),
    "cut in the number": content(number(3, 1)[:5]),
    "cut behind the number": content(number(3, 1)),
    "cut in the text": content(number(3, 1) + GOOD[:30]),
    "zeros": content(bytes(4096)),
    "no UTF-8": content(number(3, 1) + b"[\xff\xfe]"),
    "no list": content(number(3, 1) + b"3"),
    "a mapping": content(number(3, 1) + b'{"component": 1}'),
    "a list of numbers": content(number(3, 1) + b"[1, 2]"),
    "other names": content(text(pid=1)),
    "no texts": content(text(method=[1])),
    "a long text": content(text(source="x" * 100_000)),
    "orders to a terminal": content(text(source="\x1b[2J\x1b]0;owned\x07")),
    "a place that is not there": content(number(3, 9) + GOOD),
    "before all ticks": content(struct.pack("=q", -(1 << 40)) + GOOD),
    "deep": content(number(3, 1) + b"[" * 100_000),
    "huge": content(number(3, 1) + b" " * MOST_BYTES + GOOD),
    "a large number in the text": content(number(3, 1) + b"[" + b"9" * 6000 + b"]"),
    "a folder": folder,
    "a link": link,
    "a pipe": pipe,
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_a_spoilt_marker_is_said_to_be_damaged(
    spoil: Callable[[Path], None], tmp_path: Path
) -> None:
    path = tmp_path / "a" / "b" / "ses-01_run.where"
    path.parent.mkdir(parents=True)
    (tmp_path / "thesis.txt").write_text("years of work")
    spoil(path)
    assert read_crash_marker(path) == CrashMarker(-1, None, path)
    assert str(path) in str(read_crash_marker(path))
    read_number(path)


def test_bytes_at_random_are_a_place_or_damaged(tmp_path: Path) -> None:
    path, dice = tmp_path / "ses-01_run.where", random.Random(15)
    whole = number(41, 1) + GOOD
    for _ in range(2000):
        raw = bytearray(whole)
        for _ in range(dice.choice([1, 3, 40])):
            raw[dice.randrange(len(raw))] = dice.randrange(256)
        path.write_bytes(raw[: dice.randrange(len(raw) + 1)])
        found = read_crash_marker(path)
        assert found is not None
        assert str(found).isprintable()
    path.write_bytes(whole)
    assert read_crash_marker(path) == CrashMarker(41, PLACE)
    assert read_crash_marker(tmp_path / "none") is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "spoil",
    [SPOILT[name] for name in ("zeros", "no texts", "deep", "a folder", "a link", "a pipe")],
)
def test_a_session_is_recovered_and_gone_on_with_beside_a_spoilt_marker(
    spoil: Callable[[Path], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chosen, data = study(tmp_path), tmp_path / "data"
    thesis = tmp_path / "thesis.txt"
    thesis.write_text("years of work")
    visit = Visit(chosen, "P001", 1, data, simulated=True, fast=True)
    file = run(visit, ScriptedConsole({700: [Command(Order.END)]}))
    trials = len(open_recording(file).session(1).trials)
    spoil(visit.crash_marker)
    assert main(["recover", str(data)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "an unknown place, because" in said
    run(replace(visit, resumed=True, policy="redo_trial"), ScriptedConsole())
    session = open_recording(file).session(1)
    assert sum(session.trials["outcome"] == "success") == 8 > trials
    died = session.events.query("name == 'session.died'")["data"].iloc[0]
    assert died["died_in_tick"] == -1
    assert thesis.read_text() == "years of work"
    assert not os.path.lexists(visit.crash_marker)
    kept = [path.read_text() for path in data.rglob("kept")]
    assert kept == (["kept"] if spoil is folder else [])


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_a_new_marker_is_written_beside_what_was_there(
    spoil: Callable[[Path], None], tmp_path: Path
) -> None:
    path = tmp_path / "a" / "b" / "ses-01_run.where"
    path.parent.mkdir(parents=True)
    (tmp_path / "thesis.txt").write_text("years of work")
    spoil(path)
    file = CrashMarkerFile(path, [PLACE])
    file.number[0] = (5 << SHIFT) + 1
    assert read_crash_marker(path) == CrashMarker(4, PLACE)
    assert os.name != "posix" or path.stat().st_mode & 0o777 == 0o600
    file.close()
    assert not path.exists()
    assert (tmp_path / "thesis.txt").read_text() == "years of work"


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT)
def test_no_process_is_ended_for_what_a_spoilt_marker_says(
    spoil: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a" / "b" / "ses-01_run.where"
    path.parent.mkdir(parents=True)
    spoil(path)
    times = count(0.0, 0.9)
    clock = SimpleNamespace(monotonic=lambda: next(times))  # its own: threads use the module's
    monkeypatch.setattr(watch_clock, "time", clock)
    detector = HangDetector(path, lambda line: None)
    assert not any(detector.hangs() for _ in range(round(10 * HANG_S)))


@needs("links")
@pytest.mark.parametrize("hold", [exclusive, lambda path: held(path, "busy")], ids=["wait", "try"])
def test_a_link_in_a_locks_place_leaves_alone_what_it_leads_to(
    hold: Callable[[Path], object], tmp_path: Path
) -> None:
    thesis, path = tmp_path / "thesis.txt", tmp_path / "data" / "register.lock"
    path.parent.mkdir()
    thesis.write_text("years of work")
    for target in (thesis, tmp_path / "nothing"):
        path.symlink_to(target)
        with pytest.raises(RecordingError, match="as a lock: it is a link; remove"), hold(path):
            raise AssertionError("held")
        path.unlink()
    assert thesis.read_text() == "years of work"
    assert not (tmp_path / "nothing").exists()
    path.mkdir()
    with pytest.raises(RecordingError, match="as a lock: Is a directory"), hold(path):
        raise AssertionError("held")
