"""Placement of samples on our clock: by which clock each was stamped, and what is known of it."""

import itertools
from dataclasses import dataclass, field

import numpy as np

from labcrane.streams.sync.epochs import Epoch
from labcrane.streams.sync.offset import SURE, OffsetCurve, fit
from labcrane.streams.sync.quality import Basis, Segment
from labcrane.streams.sync.raw import REMOTE, RawStream
from labcrane.streams.sync.smoother import smooth
from labcrane.streams.sync.steady_sampler import SteadySampler
from labcrane.types import FloatArray

WRONG_CLOCK_S = 0.25
"""Samples that arrive this much sooner than others ever did were stamped by another clock."""

ORDER_S = 2.0
"""Samples are pushed out of order by less than this."""

LONGEST_S = 360.0
"""The first samples cannot be older: LSL keeps six minutes at most."""

EARLY_S = 0.005
"""No sample arrives so long before it was taken."""

LATE_S = 0.05
"""The least delay of a stream is below this; nothing else tells a wrong clock from a slow way."""

SOON = 0.02
FOREIGN_S = 1.0
PULL_S = 0.03
BLOCK_S = 10.0
ARRIVAL_SCATTERS_S = (0.0005, 0.002, 0.01, 0.05)


@dataclass(frozen=True, slots=True)
class Placement:
    """Times on our clock before anything is evened.

    Attributes
    ----------
    time, error
        In seconds, shape ``(n,)``: where a sample is, and how far it may be off at 95 %.
    segments
        Stretches of one clock.
    curves
        The clocks that were probed.
    least_lag
        Shortest time from a stamp to its sample's arrival; NaN when it is not known.
    whose
        What the stamps are of where they are not of the clock that was probed: "receiver" or
        "foreign"; empty where they are.
    """

    time: FloatArray
    error: FloatArray
    segments: tuple[Segment, ...] = field(default_factory=tuple)
    curves: tuple[OffsetCurve, ...] = ()
    least_lag: float = np.nan
    whose: str = ""


_Piece = tuple[int, int, Epoch, OffsetCurve | None]


def place(raw: RawStream, stretches: list[Epoch], *, regular: bool) -> Placement:
    """Place every sample, by its own clock's probes, else by arrivals, else not at all (NaN)."""
    curves = _curves(raw.stamps if regular else None, stretches)
    arrival = raw.arrival()
    least = _least_lag(raw.stamps, arrival, stretches, curves, regular=regular)
    whose = ""
    if regular and arrival is not None and np.isfinite(least):
        whose = _stamped_by(raw.stamps, arrival, least)
        if whose:
            curves = [None] * len(stretches)
    time, error = np.full((2, len(raw.stamps)), np.nan)
    pieces = _pieces(raw, arrival, stretches, curves, (least, time, error, whose), regular=regular)
    if not whose and regular and least > LATE_S:
        error += least
    known = arrival is not None
    segments = tuple(_segment(*piece, known=known) for piece in _joined(pieces))
    _blur_steps(segments, error)
    probed = tuple(curve for curve in curves if curve is not None)
    return Placement(time, error, segments, probed, least, whose)


def _curves(steady: FloatArray | None, stretches: list[Epoch]) -> list[OffsetCurve | None]:
    """Return each clock's curve, the longest known first: it lends its slope to brief ones.

    ``steady`` are the stamps of a regular stream.
    """
    curves: list[OffsetCurve | None] = [None] * len(stretches)
    slope = 0.0
    lengths = [
        np.ptp(epoch.probes[:, REMOTE]) if len(epoch.probes) else -1.0 for epoch in stretches
    ]
    for k in sorted(range(len(stretches)), key=lambda k: -lengths[k]):
        if len(stretches[k].probes):
            part = slice(stretches[k].start, stretches[k].stop)
            sampler = None if steady is None else SteadySampler.of(steady[part])
            curve = curves[k] = fit(stretches[k].probes, slope, sampler)
            slope = slope or curve.slope
    return curves


def _least_lag(
    stamps: FloatArray,
    arrival: FloatArray | None,
    stretches: list[Epoch],
    curves: list[OffsetCurve | None],
    *,
    regular: bool,
) -> float:
    """Return the shortest time from stamp to arrival of most pieces; NaN when it is not known."""
    if arrival is None:
        return np.nan
    found: list[tuple[float, int]] = []
    for epoch, curve in zip(stretches, curves, strict=True):
        if curve is not None:
            for start, stop in _ranges(stamps, arrival, epoch, regular=regular):
                part = slice(start, stop)
                lag = arrival[part] - stamps[part] - curve(stamps[part])
                found.append((_soonest(lag, arrival[part]), stop - start))
    if not found:
        return np.nan
    found.sort()
    shares = np.cumsum([count for _, count in found])
    return found[int(np.searchsorted(shares, shares[-1] / 2))][0]


def _soonest(lag: FloatArray, arrival: FloatArray) -> float:
    """Return the lag of the newest samples of chunks, when it is short."""
    starts = np.r_[0, np.flatnonzero(np.diff(arrival)) + 1]
    return float(np.quantile(np.minimum.reduceat(lag, starts), SOON))


def _stamped_by(stamps: FloatArray, arrival: FloatArray, least: float) -> str:
    """Return whose clock the stamps are of, if samples could not have come when they came."""
    raw = _soonest(arrival - stamps, arrival)
    if -EARLY_S <= raw <= LATE_S and (least < -EARLY_S or raw < least - EARLY_S):
        return "receiver"
    if -EARLY_S <= least <= LATE_S:
        return ""
    return "foreign" if least < -EARLY_S or least > FOREIGN_S else ""


def _pieces(
    raw: RawStream,
    arrival: FloatArray | None,
    stretches: list[Epoch],
    curves: list[OffsetCurve | None],
    into: tuple[float, FloatArray, FloatArray, str],
    *,
    regular: bool,
) -> list[_Piece]:
    """Write times and errors of each piece between leaps; return the pieces and their clocks."""
    least, time, error, whose = into
    found: list[_Piece] = []
    for k, epoch in enumerate(stretches):
        for start, stop in _ranges(raw.stamps, arrival, epoch, regular=regular):
            part = slice(start, stop)
            stamps = raw.stamps[part]
            chosen = curves[k]
            if arrival is not None and not whose and (chosen is None or regular):
                after = float(time[start - 1]) if start else float(arrival[0]) - least - LONGEST_S
                chosen = _whose(stamps, arrival[part], (least, after), _candidates(curves, k))
            if chosen is not None:
                offset, error[part] = chosen.with_error(stamps)
                time[part] = stamps + offset
            elif arrival is not None and whose == "receiver":
                time[part], error[part] = stamps, _spread(stamps, arrival[part])
            elif arrival is not None:
                time[part], error[part] = _by_arrival(stamps, arrival[part], least)
            found.append((start, stop, epoch, chosen))
    return found


def _joined(pieces: list[_Piece]) -> list[_Piece]:
    """Return the pieces with those of one clock put together."""
    joined: list[_Piece] = []
    for start, stop, epoch, curve in pieces:
        if joined and curve is not None and joined[-1][3] is curve:
            first, _, whose, _ = joined.pop()
            joined.append((first, stop, whose, curve))
        else:
            joined.append((start, stop, epoch, curve))
    return joined


def _candidates(curves: list[OffsetCurve | None], k: int) -> list[OffsetCurve]:
    """Return the clocks a piece may be of: its own, the next, the one before."""
    near = (curves[k], *curves[k + 1 : k + 2], *curves[max(k - 1, 0) : k])
    return [curve for curve in near if curve is not None]


def _whose(
    stamps: FloatArray,
    arrival: FloatArray,
    lag_and_order: tuple[float, float],
    candidates: list[OffsetCurve],
) -> OffsetCurve | None:
    """Return the first clock by which samples arrive when they can.

    Not sooner than any others after they were taken, and in their order. Samples that the network
    or their program held up come late together, the last of them no later than usual.
    """
    least, after = lag_and_order
    for curve in candidates:
        time = stamps + curve(stamps)
        early = float((arrival - time).min()) < least - WRONG_CLOCK_S
        if not early and not float(time.min()) < after - ORDER_S:  # after may be NaN
            return curve
    return None


def _ranges(
    stamps: FloatArray, arrival: FloatArray | None, epoch: Epoch, *, regular: bool
) -> list[tuple[int, int]]:
    """Return the ranges between leaps of the stamps that arrival does not share.

    A source that is replaced before its first probe leaves no other trace. Irregular sources may
    stamp what happened long ago, so that a leap says nothing there.
    """
    bounds = [epoch.start, epoch.stop]
    if arrival is not None and regular:
        part = slice(epoch.start, epoch.stop)
        leaps = np.abs(np.diff(stamps[part]) - np.diff(arrival[part])) > 2 * WRONG_CLOCK_S
        bounds[1:1] = [epoch.start + int(k) + 1 for k in np.flatnonzero(leaps)]
    return list(itertools.pairwise(bounds))


def _by_arrival(
    stamps: FloatArray, arrival: FloatArray, least: float
) -> tuple[FloatArray, FloatArray]:
    """Return times that make the soonest samples arrive as late as others do, and their error."""
    least = least if -EARLY_S <= least <= LATE_S else 0.0
    lag = arrival - stamps
    edges = np.flatnonzero(np.diff(np.floor((arrival - arrival[0]) / BLOCK_S))) + 1
    blocks = np.split(np.arange(len(stamps)), edges)
    soonest = np.array([block[np.argmin(lag[block])] for block in blocks])
    soonest = soonest[np.argsort(stamps[soonest], kind="stable")]
    if len(soonest) < 3 or (np.diff(stamps[soonest]) <= 0).any():  # noqa: PLR2004
        return stamps + float(lag.min()) - least, _spread(stamps, arrival)
    smoothed = smooth(
        stamps[soonest],
        lag[soonest],
        np.zeros(len(soonest)),
        scatter_s=ARRIVAL_SCATTERS_S,
    )
    offset, deviation = smoothed.at(stamps)
    return stamps + offset - least, SURE * deviation + PULL_S + LATE_S


def _spread(stamps: FloatArray, arrival: FloatArray) -> FloatArray:
    """Return how far times by arrival may be off: by how late samples come, and by a pull."""
    lag = arrival - stamps
    width = float(np.quantile(lag, 0.5) - lag.min())
    return np.full(len(stamps), width + PULL_S + LATE_S)


def _segment(
    start: int, stop: int, epoch: Epoch, curve: OffsetCurve | None, *, known: bool
) -> Segment:
    first = start == epoch.start
    unsure, step, unheard = (
        (epoch.unsure, epoch.step_s, epoch.unheard_s) if first else (0, 0.0, 0.0)
    )
    told = first and epoch.told
    if curve is None:
        basis = Basis.ARRIVALS if known else Basis.NOTHING
        return Segment(start, stop, basis, unsure=unsure, step_s=step, told=told, unheard_s=unheard)
    drift = -curve.slope / (1.0 + curve.slope) * 1e6
    residual = 1.4826 * float(np.median(np.abs(curve.residuals)))
    probes = len(curve.probes)
    return Segment(start, stop, Basis.PROBES, probes, unsure, drift, residual, step, told, unheard)


def _blur_steps(segments: tuple[Segment, ...], error: FloatArray) -> None:
    """Let samples that may be of the clock before be as uncertain as the step is large."""
    for before, after in itertools.pairwise(segments):
        if after.unsure:
            near = slice(
                max(after.start - after.unsure, before.start),
                min(after.start + after.unsure, after.stop),
            )
            error[near] += abs(after.step_s)
