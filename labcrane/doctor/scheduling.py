"""Scheduling examination: whether the operating system lets a loop tick in time."""

import itertools
import os
import sys
from pathlib import Path

import numpy as np

from labcrane.core.clock import Clock, SystemClock, ticks
from labcrane.core.findings import Finding, Verdict
from labcrane.streams.sync.report.limits import LATE
from labcrane.types import FloatArray

SECONDS = 2.0
CPUS = Path("/sys/devices/system/cpu")
SLOW_GOVERNORS = ("powersave", "conservative", "schedutil", "ondemand")
FEW_CORES = 2
"""Loop, views and sound need a core each; with fewer they take turns."""


def light() -> list[Finding]:
    """Return the findings that need no measurement: cores, governor, real-time priorities."""
    cores = os.cpu_count() or 1
    if sys.platform == "linux":
        cores = len(os.sched_getaffinity(0))
    text = f"{cores} processor core{'s' if cores > 1 else ''} to run on"
    found = [Finding(Verdict.PASS, text)]
    if cores < FEW_CORES:
        fix = "show views on another computer, or allow more cores (taskset)"
        found = [Finding(Verdict.WARN, f"{text}: loop, views and sound wait for each other", fix)]
    return [*found, *governor(CPUS), *_priorities()]


def examine(rate_hz: float) -> list[Finding]:
    """Tick for two seconds as a session does, and report the lateness."""
    late = lateness(SystemClock(), rate_hz, SECONDS)
    count = len(late)
    share = float(np.mean(late > 1.0 / rate_hz))
    middle, most, worst = (1e3 * float(np.quantile(late, at)) for at in (0.5, 0.99, 1.0))
    text = (
        f"{count} ticks at {rate_hz:g} Hz were late by {middle:.3f} ms (p50), {most:.3f} ms (p99), "
        f"{worst:.2f} ms (most); {100 * share:.1f} % by more than a period"
    )
    verdict = LATE.judge(share)
    fix = "" if verdict is Verdict.PASS else "close other programs; see the governor; lower rate_hz"
    return [Finding(verdict, text, fix), *light()]


def lateness(clock: Clock, rate_hz: float, seconds: float) -> FloatArray:
    """Return the lateness of an empty loop's ticks, in s, shape ``(n_ticks,)``."""
    count = round(seconds * rate_hz)
    return np.array(
        [tick.woke - tick.due for tick in itertools.islice(ticks(clock, rate_hz), count)]
    )


def governor(cpus: Path) -> list[Finding]:
    """Return whether the processor is allowed its full speed, below ``/sys/devices/system/cpu``."""
    files = sorted(cpus.glob("cpu[0-9]*/cpufreq/scaling_governor"))
    names = sorted({path.read_text(encoding="utf-8").strip() for path in files})
    if not names:
        return []
    text = f"the processor's governor is {', '.join(names)}"
    if set(names) & set(SLOW_GOVERNORS):
        fix = "sudo cpupower frequency-set --governor performance"
        return [Finding(Verdict.WARN, f"{text}, which wakes up slowly", fix)]
    return [Finding(Verdict.PASS, text)]


def _priorities() -> list[Finding]:
    found: list[Finding] = []
    if sys.platform == "linux":
        import resource  # noqa: PLC0415 - not on Windows

        _, most = resource.getrlimit(resource.RLIMIT_RTPRIO)
        if most != 0 or os.geteuid() == 0:
            found.append(Finding(Verdict.PASS, "real-time priorities are allowed"))
        else:
            fix = (
                "for sound by JACK: add '@audio - rtprio 95' to /etc/security/limits.d/audio.conf, "
                "join the group audio, log in again"
            )
            text = "real-time priorities are not allowed to this user"
            found.append(Finding(Verdict.WARN, text, fix))
    return found
