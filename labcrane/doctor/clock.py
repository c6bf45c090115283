"""Clock examination: its resolution, its source, and whether NTP slews it.

Timestamps are on the monotonic clock. A step of the wall clock does not affect it, but while NTP
slews, it runs fast or slow by up to 500 ppm, and other computers see that as drift.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from labcrane.core.findings import Finding, Verdict

FINE_S = 1e-6
"""Maximum step of a good clock; a tick at 1 kHz is a thousand of them."""

COARSE_S = 1e-4
GOOD_SOURCES = ("tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "xen")
SOURCE = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")

SLEW_PPM = 100.0
"""Rate of the monotonic clock against the hardware beyond which NTP is still settling."""

STEP_S = 0.005
"""Change of the wall clock against the monotonic one that is a step, not a slew."""

WATCH_S = 1.0


class ClockReading(NamedTuple):
    """Three clocks read together, in s: the hardware's, the monotonic one and the wall's."""

    raw: float
    monotonic: float
    wall: float


def read() -> ClockReading:
    """Read the clocks; the best of five attempts, so that an interruption does not show."""
    return min((_read() for _ in range(5)), key=lambda pair: pair[0])[1]


def _read() -> tuple[float, ClockReading]:
    if sys.platform == "win32":  # it slews no monotonic clock
        before = after = raw = time.perf_counter()
        wall = time.time()
    else:
        before = time.clock_gettime(time.CLOCK_MONOTONIC)
        raw = time.clock_gettime(time.CLOCK_MONOTONIC_RAW)
        wall = time.time()
        after = time.clock_gettime(time.CLOCK_MONOTONIC)
    return after - before, ClockReading(raw, (before + after) / 2.0, wall)


def light() -> list[Finding]:
    """Return the findings that need no measurement."""
    return [_resolution(), *_source(SOURCE)]


def examine(
    clocks: Callable[[], ClockReading] = read, wait: Callable[[float], None] = time.sleep
) -> list[Finding]:
    """Return the findings on the clock, after watching NTP's effect on it for a second."""
    before = clocks()
    wait(WATCH_S)
    return [*light(), *_bent(before, clocks())]


def _resolution() -> Finding:
    steps = []
    for _ in range(200):
        began = now = time.perf_counter()
        while now == began:
            now = time.perf_counter()
        steps.append(now - began)
    step = min(steps)
    text = f"the clock advances in steps of {1e9 * step:.0f} ns at most"
    if step <= FINE_S:
        return Finding(Verdict.PASS, text)
    verdict = Verdict.WARN if step <= COARSE_S else Verdict.FAIL
    return Finding(verdict, text, "use another computer or a newer kernel; see the clock source")


def _source(path: Path) -> list[Finding]:
    if not path.is_file():  # no Linux
        return []
    name = path.read_text(encoding="utf-8").strip()
    if name.startswith(GOOD_SOURCES):
        return [Finding(Verdict.PASS, f"the clock source is {name}")]
    fix = "check the kernel's log for why it dropped tsc (dmesg | grep -i clocksource)"
    return [Finding(Verdict.WARN, f"the clock source is {name}, which is slow to read", fix)]


def _bent(before: ClockReading, after: ClockReading) -> list[Finding]:
    passed = after.monotonic - before.monotonic
    ppm = 1e6 * (passed / (after.raw - before.raw) - 1.0)
    step = (after.wall - before.wall) - passed
    slew = f"the clock runs {ppm:+.1f} ppm against the hardware"
    found = []
    if abs(ppm) <= SLEW_PPM:
        found.append(Finding(Verdict.PASS, slew))
    else:
        fix = "NTP is slewing: wait until it has settled (chronyc tracking, timedatectl)"
        found.append(Finding(Verdict.WARN, f"{slew}, which other computers see as drift", fix))
    if abs(step) > STEP_S:
        text = f"the wall clock was set by {step:+.3f} s during the check"
        fix = "timestamps are not affected; wait before you compare them with times of day"
        found.append(Finding(Verdict.WARN, text, fix))
    return found
