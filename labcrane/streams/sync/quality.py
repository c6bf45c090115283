"""Quality of a stream's corrected times."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from labcrane.streams.sync.dejitter import runs
from labcrane.streams.sync.epochs import REMOTE, RTT
from labcrane.streams.sync.offset import OffsetCurve
from labcrane.streams.sync.raw import RawStream
from labcrane.types import FloatArray


class Basis(StrEnum):
    """What a stretch's offset rests on."""

    PROBES = "probes"
    ARRIVALS = "arrivals"  # no probe of this clock: right within the travel time's scatter
    NOTHING = "nothing"  # neither: times are NaN


@dataclass(frozen=True, slots=True)
class Segment:
    """Samples ``start`` to ``stop`` of one clock, and how well it is known.

    ``unsure`` counts samples that may belong to the clock before. ``drift_ppm`` is positive for a
    source whose clock is fast. Residuals are the median deviation of probes from the curve.
    """

    start: int
    stop: int
    basis: Basis
    probes: int = 0
    unsure: int = 0
    drift_ppm: float = 0.0
    residual_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Quality:
    """How right a stream's corrected times are. NaN where it is not known.

    Attributes
    ----------
    drift_ppm
        Of the clock that stamped most samples; positive when it is fast.
    residual_s
        Median absolute deviation of its probes from the curve, as a standard deviation.
    probe_age_s
        Longest time from a sample to the nearest trusted probe.
    rtt_p50_s, rtt_p95_s
        Round trips of all probes.
    rate_hz
        Samples per second while they flowed.
    lag_s
        Usual time from a stamp to the sample's arrival: far off when the stamps are of a clock
        that LSL knows nothing of.
    gaps, longest_gap_s
        Interruptions of regular streams.
    dropped
        Samples that the source's own counter says are missing.
    unsure, unprobed
        Samples near a step that may be of the other clock; samples of clocks never probed.
    """

    drift_ppm: float = np.nan
    residual_s: float = np.nan
    probe_age_s: float = np.nan
    rtt_p50_s: float = np.nan
    rtt_p95_s: float = np.nan
    rate_hz: float = np.nan
    lag_s: float = np.nan
    gaps: int = 0
    longest_gap_s: float = 0.0
    dropped: int = 0
    unsure: int = 0
    unprobed: int = 0


def assess(
    raw: RawStream,
    time: FloatArray,
    segments: Sequence[Segment],
    curves: Sequence[OffsetCurve],
    *,
    regular: bool,
) -> Quality:
    """Sum up how right corrected times are."""
    longest = max(segments, key=lambda part: part.stop - part.start, default=None)
    probed = longest is not None and longest.basis is Basis.PROBES
    trips = raw.probes[:, RTT]
    p50, p95 = np.quantile(trips, (0.5, 0.95)) if len(trips) else (np.nan, np.nan)
    rate, gaps = _flow(time[np.isfinite(time)], regular=regular)
    return Quality(
        drift_ppm=longest.drift_ppm if longest is not None and probed else np.nan,
        residual_s=longest.residual_s if longest is not None and probed else np.nan,
        probe_age_s=_probe_age(raw.stamps, curves),
        rtt_p50_s=float(p50),
        rtt_p95_s=float(p95),
        rate_hz=rate,
        lag_s=usual_lag(raw.arrival(), time),
        gaps=len(gaps),
        longest_gap_s=float(gaps.max(initial=0.0)),
        dropped=0 if raw.index is None else int(np.sum(np.maximum(np.diff(raw.index) - 1, 0))),
        unsure=sum(segment.unsure for segment in segments),
        unprobed=sum(s.stop - s.start for s in segments if s.basis is not Basis.PROBES),
    )


def usual_lag(arrival: FloatArray | None, time: FloatArray) -> float:
    """Return the usual time from a stamp to its sample's arrival; NaN when it is not known."""
    if arrival is None or not np.isfinite(time).any():
        return np.nan
    return float(np.nanmedian(arrival - time))


def _flow(time: FloatArray, *, regular: bool) -> tuple[float, FloatArray]:
    """Return samples per second while they flowed, and how long each gap was."""
    steps = np.diff(time)
    if not len(steps) or time[-1] <= time[0]:
        return np.nan, np.empty(0)
    if not regular:
        return len(steps) / float(time[-1] - time[0]), np.empty(0)
    stops = [stop for _, stop in runs(time, np.arange(len(time), dtype=np.float64))[:-1]]
    gaps = steps[np.array(stops, dtype=int) - 1]
    flowing = float(steps.sum() - gaps.sum())
    return ((len(steps) - len(gaps)) / flowing if flowing > 0 else np.nan), gaps


def _probe_age(stamps: FloatArray, curves: Sequence[OffsetCurve]) -> float:
    """Return the longest time from a sample to a probe of its clock."""
    if not curves:
        return np.nan
    known = np.sort(np.concatenate([curve.trusted[:, REMOTE] for curve in curves]))
    k = np.clip(np.searchsorted(known, stamps), 1, max(len(known) - 1, 1))
    after = known[np.minimum(k, len(known) - 1)]
    return float(np.minimum(np.abs(stamps - known[k - 1]), np.abs(stamps - after)).max())
