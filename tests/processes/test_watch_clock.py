"""Processes that wait for others and stood still themselves: they take nobody for hung."""

import random
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from labcrane.launcher.hang_detector import HANG_S, HangDetector
from labcrane.processes import watch_clock
from labcrane.processes.handle import Patience, ProcessHandle
from labcrane.processes.watch_clock import MOST_S, WatchClock
from labcrane.recording.crash_marker import SHIFT, CrashMarkerFile, Place

PLACE = Place("dynamics 'bullet_crane'", "bullet", "step", "bullet_crane.py:12")
PATIENCE_S = 10.0


class Computer:
    """A computer whose time the test drives."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def computer(monkeypatch: pytest.MonkeyPatch) -> Computer:
    driven = Computer()
    monkeypatch.setattr(watch_clock, "time", SimpleNamespace(monotonic=driven.monotonic))
    return driven


@pytest.mark.parametrize("seed", range(8))
def test_of_the_time_between_two_readings_at_most_a_second_counts(
    seed: int, computer: Computer
) -> None:
    clock = WatchClock()
    steps = random.Random(seed).choices((0.0, 0.05, 0.7, 1.0, 3.0, 3600.0), k=50)
    for step in steps:
        computer.now += step
        clock()
    assert clock() == pytest.approx(sum(min(step, MOST_S) for step in steps))


@contextmanager
def a_component_that_hangs(folder: Path) -> Iterator[Callable[[], bool]]:
    marker = CrashMarkerFile(folder / "ses-01_run.where", [PLACE])
    marker.number[0] = (5 << SHIFT) + 1
    detector = HangDetector(folder / "ses-01_run.where", lambda line: None)
    yield detector.hangs
    marker.close()


@contextmanager
def a_process_that_says_nothing(folder: Path) -> Iterator[Callable[[], bool]]:
    process = ProcessHandle(
        "labcrane.streams.recorder.process", "silent", Patience(silent_s=PATIENCE_S)
    )
    process.start()
    process.ready = True
    yield lambda: process.failure is not None
    process.kill()


@pytest.mark.parametrize("silent", [a_component_that_hangs, a_process_that_says_nothing])
def test_only_what_is_silent_while_it_is_watched_is_taken_for_hung(
    silent: Callable[[Path], AbstractContextManager[Callable[[], bool]]],
    computer: Computer,
    tmp_path: Path,
) -> None:
    assert HANG_S == PATIENCE_S
    with silent(tmp_path) as hangs:
        assert not hangs()
        for _ in range(3):  # the one who looks is stopped for a minute, and looks at once
            computer.now += 60.0
            assert not hangs()
        looks = 0
        while not hangs():
            computer.now += 0.5
            looks += 1
            assert looks < 100
        assert 0.5 * looks == pytest.approx(PATIENCE_S - 3 * MOST_S, abs=0.51)
