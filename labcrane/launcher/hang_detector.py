"""Detector of a session that hangs in a component, from outside its process."""

from collections.abc import Callable
from pathlib import Path

from labcrane.processes.watch_clock import WatchClock
from labcrane.recording.crash_marker import read_crash_marker, read_number

TELL_S = 2.0
"""A session that has not advanced for so long, in seconds, is reported."""

HANG_S = 10.0
"""A component that delays a tick for so long, in seconds, hangs: its process is killed."""

OPEN_S = 60.0
"""The same before the first tick, when engines and devices are opened."""


class HangDetector:
    """Watches the file in which a session says where it is."""

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        self._path = path
        self._say = say
        self._number: int | None = None
        self._clock = WatchClock()
        self._since = self._clock()
        self._told = False

    def hangs(self) -> bool:
        """Look again; return whether a component has had the process for too long."""
        number, now = read_number(self._path), self._clock()
        if number is None or number != self._number:
            self._number, self._since, self._told = number, now, False
            return False
        still = now - self._since
        if still < TELL_S or (where := read_crash_marker(self._path)) is None:
            return False
        patience = OPEN_S if where.tick < 0 else HANG_S
        if not self._told and (where.tick >= 0 or still > HANG_S):
            self._told = True
            then = f"; after {patience:.0f} s its process is killed" if where.place else ""
            self._say(f"the session has not advanced for {still:.0f} s in {where}{then}")
        return where.place is not None and still > patience
