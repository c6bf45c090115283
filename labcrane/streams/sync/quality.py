"""Quality of a stream's corrected times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from labcrane.types import FloatArray

ASLEEP_S = 1.0
"""Shorter than this no computer sleeps."""

LONG_PAUSE = 8.0


class Basis(StrEnum):
    """What a stretch's offset rests on."""

    PROBES = "probes"
    ARRIVALS = "arrivals"  # no probe of this clock: right within the travel time's scatter
    NOTHING = "nothing"  # neither: times are NaN


@dataclass(frozen=True, slots=True)
class ClockSegment:
    """Samples ``start`` to ``stop`` of one clock, and how well it is known.

    ``unsure`` counts samples that may belong to the clock before. ``drift_ppm`` is positive for a
    source whose clock is fast. Residuals are the median deviation of probes from the curve.
    ``step_s`` is by how much the offset changed at its start, ``told`` whether liblsl said why,
    ``unheard_s`` for how long its clock was not probed before.
    """

    start: int
    stop: int
    basis: Basis
    probes: int = 0
    unsure: int = 0
    drift_ppm: float = 0.0
    residual_s: float = 0.0
    step_s: float = 0.0
    told: bool = False
    unheard_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Quality:
    """How right a stream's corrected times are. NaN where it is not known. Times are seconds.

    Attributes
    ----------
    error_p50_s, error_p95_s
        The stated uncertainty, at 95 %, of half of the samples and of nearly all.
    made_of_s
        What the latter is made of, by the name of each term.
    worst_s, worst_at_s
        The largest uncertainty over a second, and when that second begins, on our clock.
    hidden_s
        Half of the shortest round trip, which a lasting asymmetry of the path may hide.
    drift_ppm
        Of the clock that stamped most samples; positive when it is fast.
    residual_s
        Median absolute deviation of its probes from the curve, as a standard deviation.
    probe_age_s
        Longest time from a sample to the nearest probe of its clock.
    rtt_p50_s, rtt_p95_s
        Round trips of all probes.
    rate_hz
        Samples per second while they flowed.
    first_rate_hz, last_rate_hz
        The rates before and after it changed; NaN where it did not.
    lag_s
        Shortest time from a stamp to its sample's arrival: far off when the stamps are of a clock
        that LSL knows nothing of.
    gaps, longest_gap_s
        Interruptions of regular streams.
    dropped
        Samples that are missing, by the source's own counter or by whole periods between stamps.
    uncounted
        1 where stamps scatter by so much that single lost samples cannot be counted.
    disordered
        Samples that came after one stamped later.
    stalls, longest_stall_s
        How often samples came in a burst after a pause, and how late.
    noise_s
        By how much stamps scatter that were not taken with the samples, at 95 %.
    uneven_s
        By how much stamps scatter about a steady clock, at 95 %, that are taken to be right.
    grid_s
        Unit that stamps are cut or rounded to; 0 where they are not.
    late_stamps
        1 where chunks are stamped when they are sent.
    stamped, contradicted
        When samples are stamped, as far as that is declared; what stamps are by themselves where
        they contradict it.
    shifts, shift_s
        How often stamps are later, or sooner, from one sample on, by the largest shift.
    moved_p95_s, moved_max_s
        By how much evening moved samples.
    steps, restarts, sleeps, slews
        How often its clock jumped, its program restarted, its computer slept, its clock was turned
        faster or slower.
    congested_s
        How long probes took far longer than usual, one after the other.
    silent_s
        From its last sample to the end of the recording; of irregular streams, from when their
        program did not answer probes any more, either.
    unsure, unprobed
        Samples near a step that may be of the other clock; samples of clocks never probed.
    whose
        Whose clock the stamps are of, where it is not the probed one: "receiver" or "foreign".
    frozen
        Samples of regular streams that repeat the stamp of the one before.
    backward
        Samples that are placed before one that came earlier, or where it is, and may be late
        ones or of a clock that was set back.
    ahead_s
        By how much irregular samples came before they happened, by their stamps; 0 if none did.
    """

    error_p50_s: float = np.nan
    error_p95_s: float = np.nan
    made_of_s: Mapping[str, float] = field(default_factory=dict)
    worst_s: float = np.nan
    worst_at_s: float = np.nan
    hidden_s: float = np.nan
    drift_ppm: float = np.nan
    residual_s: float = np.nan
    probe_age_s: float = np.nan
    rtt_p50_s: float = np.nan
    rtt_p95_s: float = np.nan
    rate_hz: float = np.nan
    first_rate_hz: float = np.nan
    last_rate_hz: float = np.nan
    lag_s: float = np.nan
    gaps: int = 0
    longest_gap_s: float = 0.0
    dropped: int = 0
    uncounted: int = 0
    disordered: int = 0
    stalls: int = 0
    longest_stall_s: float = 0.0
    noise_s: float = 0.0
    uneven_s: float = 0.0
    grid_s: float = 0.0
    late_stamps: int = 0
    stamped: str = ""
    contradicted: str = ""
    shifts: int = 0
    shift_s: float = 0.0
    moved_p95_s: float = 0.0
    moved_max_s: float = 0.0
    steps: int = 0
    restarts: int = 0
    sleeps: int = 0
    slews: int = 0
    congested_s: float = 0.0
    silent_s: float = 0.0
    unsure: int = 0
    unprobed: int = 0
    whose: str = ""
    frozen: int = 0
    backward: int = 0
    ahead_s: float = 0.0


def worst_second(time: FloatArray, error: FloatArray) -> tuple[float, float]:
    """Return the largest error over a second, and when that second begins; NaN if unknown."""
    known = np.isfinite(time) & np.isfinite(error)
    if not known.any():
        return np.nan, np.nan
    k = int(np.argmax(np.where(known, error, -np.inf)))
    return float(error[k]), float(np.floor(time[k]))


def probe_age(stamps: FloatArray, segments: Sequence[ClockSegment], known: FloatArray) -> float:
    """Return the longest time from a sample to a probe of its clock; NaN without probes."""
    probed = [segment for segment in segments if segment.basis is Basis.PROBES]
    if not len(known) or not probed:
        return np.nan
    known = np.sort(known)
    ages = []
    for segment in probed:
        part = stamps[segment.start : segment.stop]
        k = np.clip(np.searchsorted(known, part), 1, max(len(known) - 1, 1))
        after = known[np.minimum(k, len(known) - 1)]
        ages.append(np.minimum(np.abs(part - known[k - 1]), np.abs(part - after)).max())
    return float(max(ages))


def clock_changes(segments: Sequence[ClockSegment], time: FloatArray) -> tuple[int, int, int]:
    """Return how often the clock stepped, its program restarted, its computer slept.

    While a computer sleeps its clock stands still: it falls behind by as long as nothing comes, be
    it samples or answers to probes.
    """
    steps = restarts = sleeps = 0
    steps_s = np.diff(time)
    steps_s = steps_s[np.isfinite(steps_s)]
    usual = float(np.median(steps_s)) if len(steps_s) else np.nan
    for segment in segments:
        if segment.told:
            restarts += 1
        elif segment.step_s and segment.start:
            pause = float(time[segment.start] - time[segment.start - 1])
            quiet = min(pause, segment.unheard_s) > segment.step_s - 0.5
            if segment.step_s > ASLEEP_S and quiet and pause > LONG_PAUSE * usual:
                sleeps += 1
            else:
                steps += 1
    return steps, restarts, sleeps
