"""Certificate of a stream's stamps in words.

What is wrong with them by name, what they carry, what was done, and what stays hidden.
"""

from collections.abc import Callable
from enum import StrEnum

import numpy as np

from labcrane.streams.sync.quality import Quality
from labcrane.streams.sync.report.limits import GAP_S, LAG_S, PROBE_AGE_S, RATE, SILENT_S
from labcrane.streams.sync.terms import in_words

CONGESTED_S = 10.0


class Fault(StrEnum):
    """What may be wrong with a stream, in the words of its report."""

    LOST = "lost samples"
    INTERRUPTED = "interrupted"
    DISORDERED = "out of order"
    STALLED = "stalled and sent late"
    WRONG_RATE = "wrong nominal rate"
    CHANGED_RATE = "changing rate"
    RECEIVER = "stamps of the receiver's clock"
    FOREIGN = "stamps of an unknown clock"
    AHEAD = "stamped ahead"
    SLOW = "stamps long before arrival"
    LATE_STAMPS = "stamped when sent"
    NOISY = "noisy stamps"
    COARSE = "stamps cut to a coarse unit"
    SHIFTED = "paused, or delay changed"
    FROZEN = "stamps that stand still"
    STEPPED = "clock stepped"
    RESTARTED = "restarted"
    SLEPT = "computer slept"
    SLEWED = "clock slewed"
    CONGESTED = "network congested"
    DIED = "died"
    UNPROBED = "never probed"
    PROBES_MISSING = "probes interrupted"


_FAULTS: dict[Fault, Callable[[Quality, float], bool]] = {
    Fault.INTERRUPTED: lambda q, _: q.longest_gap_s > GAP_S.fail,
    Fault.WRONG_RATE: lambda q, hz: (
        np.isnan(q.first_rate_hz) and abs(q.rate_hz / hz - 1.0) > RATE.warn
    ),
    Fault.CHANGED_RATE: lambda q, _: bool(np.isfinite(q.first_rate_hz)),
    Fault.LATE_STAMPS: lambda q, _: q.late_stamps > 0,
    Fault.NOISY: lambda q, _: q.noise_s > 0.0 and not q.late_stamps,
    Fault.SHIFTED: lambda q, _: q.shifts > 0,
    Fault.FROZEN: lambda q, _: q.frozen > 0,
}
"""Of regular streams only."""

_ANY_STREAMS_FAULTS: dict[Fault, Callable[[Quality], bool]] = {
    Fault.LOST: lambda q: q.dropped > 0,
    Fault.DISORDERED: lambda q: q.disordered > 0,
    Fault.STALLED: lambda q: q.stalls > 0,
    Fault.COARSE: lambda q: q.grid_s > 0.0,
    Fault.DIED: lambda q: q.silent_s > SILENT_S.warn,
    Fault.STEPPED: lambda q: q.steps > 0,
    Fault.RESTARTED: lambda q: q.restarts > 0,
    Fault.SLEPT: lambda q: q.sleeps > 0,
    Fault.SLEWED: lambda q: q.slews > 0,
    Fault.CONGESTED: lambda q: q.congested_s > CONGESTED_S,
    Fault.UNPROBED: lambda q: not q.whose and q.unprobed > 0,
    Fault.RECEIVER: lambda q: q.whose == "receiver",
    Fault.FOREIGN: lambda q: q.whose == "foreign",
    Fault.AHEAD: lambda q: q.ahead_s > 0.0,
    Fault.SLOW: lambda q: not q.whose and q.lag_s > LAG_S.warn,
    Fault.PROBES_MISSING: lambda q: q.probe_age_s > PROBE_AGE_S.fail,
}


def faults(quality: Quality, rate_hz: float) -> frozenset[Fault]:
    """Return the faults of a stream with this nominal rate; 0 is irregular."""
    found = {fault for fault, is_there in _ANY_STREAMS_FAULTS.items() if is_there(quality)}
    if rate_hz > 0.0:
        found |= {fault for fault, is_there in _FAULTS.items() if is_there(quality, rate_hz)}
    return frozenset(found)


CARRIES = (
    (0.001, "single-trial ERP, averaged ERP, gaze, movement"),
    (0.004, "averaged ERP, gaze, movement; not single-trial ERP"),
    (0.010, "gaze, movement; no ERP"),
    (0.050, "movement; neither ERP nor gaze"),
)
"""Uncertainty at 95 % up to which stamps carry an analysis, in seconds: a quarter of the finest
feature, which for a single-trial latency is 4 ms and for a fixation 40 ms."""


def carries(quality: Quality) -> str:
    """Return which analyses the stamps carry, in words."""
    for limit, words in CARRIES:
        if quality.error_p95_s <= limit:
            return words
    return "the order of events at most: no ERP, no gaze, no movement"


def corrections(quality: Quality) -> list[str]:
    """Return how well times are known, and how they were mapped, one sentence each.

    What happened to a clock, and that it was corrected, its findings say.
    """
    done = []
    if quality.made_of_s:
        done.append(f"uncertain by {in_words(quality.error_p95_s, quality.made_of_s)}")
    if quality.stamped and not quality.contradicted:
        done.append(f"declared, not measured: stamped {quality.stamped.replace('_', ' ')}")
    if np.isfinite(quality.drift_ppm):
        done.append(f"mapped from a clock that runs {quality.drift_ppm:+.1f} ppm off")
    if quality.moved_max_s > 0.0:
        done.append(
            f"dejittering moved 95 % of samples by less than {1e3 * quality.moved_p95_s:.3f} ms, "
            f"the furthest by {1e3 * quality.moved_max_s:.3f} ms"
        )
    return done


def unknowable(quality: Quality) -> str:
    """Return what no software can know of the stamps."""
    if np.isnan(quality.hidden_s):
        return "without probes the error of its clock is unbounded"
    return (
        f"a lasting asymmetry of the network may hide {1e3 * quality.hidden_s:.3f} ms, half of the "
        "shortest round trip; ask the maker about delays in the device before the timestamp"
    )
