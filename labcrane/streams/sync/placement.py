"""Placement of samples on our clock: by which clock each was stamped, and what is known of it."""

import itertools
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from labcrane.streams.sync.epochs import Epoch
from labcrane.streams.sync.offset import SURE, OffsetCurve, fit
from labcrane.streams.sync.quality import Basis, ClockSegment
from labcrane.streams.sync.raw import REMOTE, RawStream
from labcrane.streams.sync.smoother import smooth
from labcrane.streams.sync.terms import Term, Terms
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

SOONER_S = 0.0005
"""Beyond what probes leave open, no stamp of the probed clock is so long after its arrival."""

AHEAD_S = 0.05
"""Markers are stamped with what is to come by no more: three frames of a slow display."""

USUAL_LAG_S = 0.0005
"""Nothing needs longer from one program to the next, unless something holds it up."""

SHORT_LAG_S = 0.0002
"""Most of these lags are shorter than this."""

LAG_BLUR_S = 0.00005
"""So near each other are the two bounds of a lag, at most, that arrivals are to show."""

ONE_IN = 1000
"""One of so many pulls may show a lag by chance."""

SOON = 0.02
FOREIGN_S = 60.0
"""No device holds its samples back for longer. Up to then a stamp that is older than its arrival
may be right, and the probes agree that it is: the lag is stated, and nothing is moved.
"""

PULL_S = 0.03
BLOCK_S = 10.0
LAG_BLOCK_S, LAG_BLOCK = 30.0, 40
"""So long, and of so many samples of irregular streams, lags are looked at together."""

FROZEN_SHARE = 0.2
"""Where more samples repeat a stamp, chunks have one each."""

FEW_STANDS = 0.01
"""Stands of more than this part of all stamps are chunks that share one."""

LONG_STAND = 4
"""So many samples of one stamp are more than a poll hands over now and then."""

ARRIVAL_SCATTERS_S = (0.0005, 0.002, 0.01, 0.05)


@dataclass(frozen=True, slots=True)
class Placement:
    """Times on our clock before dejittering.

    Attributes
    ----------
    time
        Where each sample is, in seconds, shape ``(n,)``.
    terms
        Why it may be elsewhere, and by how much.
    segments
        Stretches of one clock.
    curves
        The clocks that were probed.
    least_lag
        Shortest time from a stamp to its sample's arrival; NaN when it is not known.
    whose
        What the stamps are of where they are not of the clock that was probed: "receiver" or
        "foreign"; empty where they are.
    frozen, long_frozen
        Samples that have the stamp of the one before, though others have their own; and those of
        them that several others repeat, too.
    ahead_s
        By how much irregular samples came before they happened, by their stamps; 0 if none did.
    """

    time: FloatArray
    terms: Terms
    segments: tuple[ClockSegment, ...] = field(default_factory=tuple)
    curves: tuple[OffsetCurve, ...] = ()
    least_lag: float = np.nan
    whose: str = ""
    frozen: int = 0
    long_frozen: int = 0
    ahead_s: float = 0.0


_Piece = tuple[int, int, Epoch, OffsetCurve | None]


def place(raw: RawStream, stretches: list[Epoch], *, regular: bool) -> Placement:
    """Place every sample, by its own clock's probes, else by arrivals, else not at all (NaN)."""
    curves = _curves(stretches)
    arrival = raw.arrival()
    least = _least_lag(raw.stamps, arrival, stretches, curves, regular=regular)
    whose, ahead = "", 0.0
    if arrival is not None and np.isfinite(least):
        hidden = max(curve.least_rtt / 2.0 for curve in curves if curve is not None)
        whose = _stamped_by(raw.stamps, arrival, (least, hidden), regular=regular)
    known = raw, arrival, stretches
    time, error, segments = _placed(known, curves, least, whose, regular=regular)
    near, late = _near_steps(segments, len(time)), np.zeros(len(time))
    if arrival is not None and np.isfinite(least) and not whose:
        lags = _lags(time, error + near, arrival, regular=regular)
        if lags is None:
            whose = "foreign"
            time, error, segments = _placed(known, curves, least, whose, regular=regular)
            near = _near_steps(segments, len(time))
        else:
            ahead = 0.0 if regular else _ahead(arrival - time, error + near)
            late = np.maximum(ahead, lags - error - near)
    if whose:
        curves = [None] * len(stretches)
    probed = tuple(curve for curve in curves if curve is not None)
    stands, frozen = np.zeros(len(time)), (0, 0)
    if regular:
        frozen = _hold_frozen(raw.stamps, time, stands)
    terms: dict[str, FloatArray] = {
        Term.CLOCK: error,
        Term.LAG: late,
        Term.STAMPS: stands,
        Term.LOSSES: near,
    }
    return Placement(time, terms, segments, probed, least, whose, *frozen, ahead)


def _ahead(lag: FloatArray, error: FloatArray) -> float:
    """Return by how much irregular samples came before they happened, by their stamps.

    A program that knows when a picture will be shown may stamp it so. A clock that is ahead of the
    probed one looks alike: the uncertainty holds both.
    """
    if not _came_early(lag, error):
        return 0.0
    return float(-lag.min()) + SHORT_LAG_S + PULL_S * max(2.0 / len(lag), 0.1)


def _came_early(lag: FloatArray, error: FloatArray) -> bool:
    return int(np.count_nonzero(lag + error < -SOONER_S)) >= max(2, 0.02 * len(lag))


def moving(stamps: FloatArray) -> npt.NDArray[np.intp]:
    """Return the samples that do not repeat, with several others, the stamp of the one before."""
    starts = np.flatnonzero(np.r_[True, np.diff(stamps) != 0.0])
    counts = np.diff(np.r_[starts, len(stamps)])
    first = np.repeat(starts, counts) == np.arange(len(stamps))
    return np.flatnonzero(first | (np.repeat(counts, counts) < LONG_STAND))


def _hold_frozen(stamps: FloatArray, time: FloatArray, error: FloatArray) -> tuple[int, int]:
    """Let samples of one stamp be anywhere until the next stamp; return how many repeat one.

    And how many do so with several others.
    """
    same = np.diff(stamps) == 0.0
    if not same.any():
        return 0, 0
    starts = np.r_[0, np.flatnonzero(~same) + 1]
    stops = np.r_[starts[1:], len(stamps)]
    counts = stops - starts
    long = counts >= LONG_STAND
    usual = counts if long.mean() > FEW_STANDS else counts[~long]
    if (usual - 1).sum() > FROZEN_SHARE * usual.sum():
        return 0, 0
    several = stops - starts > 1
    for start, stop in zip(starts[several], stops[several], strict=True):
        after = time[min(stop, len(time) - 1)] - time[start]
        before = time[start] - time[max(start - 1, 0)]
        error[start:stop] += max(abs(after), abs(before))
    more = stops - starts - 1
    return int(more.sum()), int(more[more >= LONG_STAND - 1].sum())


def _curves(stretches: list[Epoch]) -> list[OffsetCurve | None]:
    """Return each clock's curve, the longest known first: it lends its slope to brief ones."""
    curves: list[OffsetCurve | None] = [None] * len(stretches)
    slope = 0.0
    lengths = [
        np.ptp(epoch.probes[:, REMOTE]) if len(epoch.probes) else -1.0 for epoch in stretches
    ]
    for k in sorted(range(len(stretches)), key=lambda k: -lengths[k]):
        if len(stretches[k].probes):
            curve = curves[k] = fit(stretches[k].probes, slope)
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


def _stamped_by(
    stamps: FloatArray, arrival: FloatArray, least_and_hidden: tuple[float, float], *, regular: bool
) -> str:
    """Return whose clock the stamps are of, if samples could not have come when they came."""
    least, hidden = least_and_hidden
    raw = _soonest(arrival - stamps, arrival)
    early = SOONER_S + hidden
    if -early <= raw <= LATE_S and (least < -early or raw < least - 2.0 * early):
        return "receiver"
    # Where no sample is due, what seems to be too early may be the curve's own uncertainty.
    sooner = EARLY_S if regular else WRONG_CLOCK_S
    if -sooner <= least <= LATE_S:
        return ""
    return "foreign" if least < -sooner or least > FOREIGN_S else ""


def _lags(
    time: FloatArray, error: FloatArray, arrival: FloatArray, *, regular: bool
) -> FloatArray | None:
    """Return by how much arrivals allow the stamps to be off, shape ``(n,)``, in seconds.

    A stamp may be too early by as long as its samples took at least, be it on their way or by a
    clock that is behind, whether that stays or grows. None where they came before they were taken:
    then the stamps are of another clock than that which was probed.
    """
    starts = np.r_[0, np.flatnonzero(np.diff(arrival)) + 1]
    parts = _parts((arrival[starts] - arrival[0]) / LAG_BLOCK_S if regular else starts / LAG_BLOCK)
    found = (_even_lags if regular else _uneven_lags)(time, error, arrival, starts, parts)
    if found is None:
        return None
    high, low, shown = found
    usual = (high <= USUAL_LAG_S) | (low <= USUAL_LAG_S) & regular
    late = np.where(usual, np.minimum(np.maximum(high, SHORT_LAG_S), shown), high)
    late = np.maximum(late, SHORT_LAG_S - high)
    around = np.pad(late, 1, mode="reflect", reflect_type="odd")  # a lag that grows goes on
    late = np.maximum(late, np.maximum(around[:-2], around[2:]))
    counts = np.diff([*(int(starts[part[0]]) for part in parts), len(time)])
    return np.asarray(np.nan_to_num(np.repeat(late, counts), posinf=0.0))


def _parts(blocks: FloatArray) -> list[npt.NDArray[np.intp]]:
    """Return the pulls by block: where each began is given, counted in blocks."""
    parts = np.split(np.arange(len(blocks)), np.flatnonzero(np.diff(np.floor(blocks))) + 1)
    if len(parts) > 1 and len(parts[-1]) < len(parts[-2]) / 2:
        parts[-2:] = [np.concatenate(parts[-2:])]
    return parts


_Lags = tuple[FloatArray, FloatArray, float]
"""The least lag of each block of pulls, one that it is not below, and that of all as shown."""


def _even_lags(
    time: FloatArray,
    error: FloatArray,
    arrival: FloatArray,
    starts: npt.NDArray[np.intp],
    parts: list[npt.NDArray[np.intp]],
) -> _Lags | None:
    """Return the lags of a stream whose next sample is due at a known time."""
    lag = arrival - time
    allowed = np.minimum.reduceat(lag + error, starts)
    impossible = [_quantile(allowed[part], SOON) < -SOONER_S for part in parts]
    if np.mean(impossible) > 0.2:  # noqa: PLR2004
        return None
    least = np.minimum.reduceat(lag, starts)
    # The next sample had not come by then: it tells a lag from pulls that wait for a sample.
    unit = max(int(np.gcd.reduce(np.diff(starts))), 1) if len(starts) > 1 else 1
    soonest = np.minimum(starts[1:] + unit - 1, len(time) - 1)  # the last pull may be a part of one
    before = np.r_[arrival[starts[:-1]] - time[soonest], np.nan]
    high = np.array([_quantile(least[part], SOON) for part in parts])
    low = np.array([_quantile(before[part], 0.9) for part in parts])
    return high, low, _shown(least, before, LAG_BLUR_S, _scatter(time))


def _uneven_lags(
    time: FloatArray,
    error: FloatArray,
    arrival: FloatArray,
    starts: npt.NDArray[np.intp],
    parts: list[npt.NDArray[np.intp]],
) -> _Lags | None:
    """Return the lags of a stream whose next sample may be taken at any time."""
    lag = arrival - time
    early = _came_early(lag, error)
    if early and _quantile(lag, 1.0 / ONE_IN) < -AHEAD_S:
        return None
    least = np.minimum.reduceat(lag, starts)
    high = np.array([_quantile(least[part], 0.0) for part in parts])
    low = high - PULL_S / 10.0
    sure = error <= 2.0 * np.nanmedian(error)  # none near a step
    high[low <= USUAL_LAG_S] = lag[sure].min(initial=np.inf)
    before = arrival[starts[:-1]] - np.minimum.reduceat(time, starts)[1:]
    blur = max(2.0 * LAG_BLUR_S, 2.0 * PULL_S / len(time))
    return high, low, _shown(np.where(sure[starts], least, np.nan), before, blur)


def _shown(least: FloatArray, before: FloatArray, blur: float, scatter: float = 0.0) -> float:
    """Return how long all samples take at least, as far as arrivals show that.

    The soonest came so late, whether they waited for a pull or not; and samples that had not come
    by the pull before took longer than until then. Beyond what both say, they may have waited.

    Parameters
    ----------
    least
        From the stamp of each pull's soonest sample to the pull, shape ``(n_pulls,)``.
    before
        From the stamp of the next sample to the pull, shape ``(n_pulls,)``.
    blur
        By how much the first may be beyond the second, where neither is exact.
    scatter
        Of the stamps about their samples.
    """
    few = len(least) // ONE_IN
    soonest, latest = np.sort(least[np.isfinite(least)]), np.sort(before[np.isfinite(before)])
    if not len(soonest) or not len(latest):
        return SHORT_LAG_S
    high = float(soonest[min(few, len(soonest) - 1)]) + 4.0 * scatter
    low = float(latest[max(len(latest) - 1 - few, 0)]) + blur
    return max(min(low, high), SHORT_LAG_S)


def _quantile(values: FloatArray, part: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, part)) if len(known) else 0.0


def _scatter(time: FloatArray) -> float:
    """Return by how much stamps of an even stream scatter: the standard deviation of most."""
    steps = np.diff(time)
    if not len(steps):
        return 0.0
    return float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))


def _placed(
    known: tuple[RawStream, FloatArray | None, list[Epoch]],
    curves: list[OffsetCurve | None],
    least: float,
    whose: str,
    *,
    regular: bool,
) -> tuple[FloatArray, FloatArray, tuple[ClockSegment, ...]]:
    """Return times, errors and segments, where it is known whose clock the stamps are of."""
    raw, arrival, stretches = known
    if whose:
        least, curves = 0.0, [None] * len(stretches)
    time, error = np.full((2, len(raw.stamps)), np.nan)
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
            if found and chosen is not None and found[-1][3] is chosen:  # of the same clock
                first, _, before, _ = found.pop()
                found.append((first, stop, before, chosen))
            else:
                found.append((start, stop, epoch, chosen))
    return time, error, tuple(_segment(*each, known=arrival is not None) for each in found)


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
) -> ClockSegment:
    first = start == epoch.start
    unsure, step, unheard = (
        (epoch.unsure, epoch.step_s, epoch.unheard_s) if first else (0, 0.0, 0.0)
    )
    told = first and epoch.told
    if curve is None:
        basis = Basis.ARRIVALS if known else Basis.NOTHING
        return ClockSegment(
            start, stop, basis, unsure=unsure, step_s=step, told=told, unheard_s=unheard
        )
    drift = -curve.slope / (1.0 + curve.slope) * 1e6
    residual = 1.4826 * float(np.median(np.abs(curve.residuals)))
    probes = len(curve.probes)
    return ClockSegment(
        start, stop, Basis.PROBES, probes, unsure, drift, residual, step, told, unheard
    )


def _near_steps(segments: tuple[ClockSegment, ...], count: int) -> FloatArray:
    """Return by how much samples near a step may be off: they may be of the clock before."""
    error = np.zeros(count)
    for before, after in itertools.pairwise(segments):
        if after.unsure:
            near = slice(
                max(after.start - after.unsure, before.start),
                min(after.start + after.unsure, after.stop),
            )
            error[near] += abs(after.step_s)
    return error
