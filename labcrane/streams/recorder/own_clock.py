"""Log of the recorder's own clock beside one that nothing turns, where the system has it.

All stamps end on CLOCK_MONOTONIC. A daemon of NTP turns it faster or slower to set the wall clock
right, and all other computers then seem to be turned the other way. Linux has CLOCK_MONOTONIC_RAW,
which is left alone, and tells by adjtimex what the daemon asked for (man clock_gettime, adjtimex).
"""

import ctypes
import sys
import time
from typing import NamedTuple

TRIES = 4
PPM = 65536.0
"""The kernel counts frequencies in 2**-16 parts per million."""


class ClockPair(NamedTuple):
    """Both clocks at one moment, in the order in which it is stored.

    Attributes
    ----------
    time, raw
        CLOCK_MONOTONIC and CLOCK_MONOTONIC_RAW, in seconds.
    frequency_ppm, tick_us, offset_s
        What adjtimex tells: by how much the clock is turned, the length of a tick, and what is left
        of an offset that is being worked off.
    """

    time: float
    raw: float
    frequency_ppm: float
    tick_us: float
    offset_s: float


class _Timex(ctypes.Structure):
    """The kernel's struct timex, as far as the tick."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("constant", ctypes.c_long),
        ("precision", ctypes.c_long),
        ("tolerance", ctypes.c_long),
        ("seconds", ctypes.c_long),
        ("microseconds", ctypes.c_long),
        ("tick", ctypes.c_long),
        ("rest", ctypes.c_char * 256),
    )


NANO = 0x2000
"""Of the status: the offset is in nanoseconds."""


def read_own_clock() -> ClockPair | None:
    """Return how the clocks stand now; None on a system without one that nothing turns."""
    if sys.platform.startswith("linux"):
        pairs = []
        for _ in range(TRIES):  # the one that nothing came between
            before = time.clock_gettime(time.CLOCK_MONOTONIC)
            raw = time.clock_gettime(time.CLOCK_MONOTONIC_RAW)
            after = time.clock_gettime(time.CLOCK_MONOTONIC)
            pairs.append((after - before, (before + after) / 2.0, raw))
        _, now, raw = min(pairs)
        asked = _Timex()
        if ctypes.CDLL(None).adjtimex(ctypes.byref(asked)) < 0:
            return ClockPair(now, raw, float("nan"), float("nan"), float("nan"))
        unit = 1e-9 if asked.status & NANO else 1e-6
        return ClockPair(now, raw, asked.freq / PPM, float(asked.tick), unit * asked.offset)
    else:  # noqa: RET505 - mypy takes what follows a return for unreachable elsewhere
        return None
