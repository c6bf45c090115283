"""Sampling of a regular stream, as its stamps, arrivals and counter show it together.

Lost samples, disorder, a changing rate, and whether stamps scatter because samples were taken so,
or because they were stamped so.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from labcrane.streams.sync.stamping import holes, levels, receipt, shifts, units, wander
from labcrane.streams.sync.stamping.late_chunks import lost_before, lost_between, slope
from labcrane.streams.sync.stamping.receipt import EQUAL_S, SAME
from labcrane.types import FloatArray

FEW = 20
BLOCKS = 200
MANY, SPAN = 400, 150
CLUMPED = 0.5
"""Where the usual step is less than this part of the period, samples are stamped in bursts."""

BURST = 1.0 / 3.0
"""No sampler goes faster for a while by more: what seems to is sent behind a stall."""

EXACT = 0.1
"""Stamps that scatter by less than this part of a period leave no doubt which are missing."""

FEW_LOST = 0.1
"""Where more steps than this part are of several periods, they may be those of polls."""

WHOLE = 0.25
"""A step this close to whole periods has lost whole samples."""

EARLIER = 0.1
"""At least this part of chunks stamped when sent waited for less than the one before."""

RATE_CHANGE = 1e-3
LEAST_NOISE_S = 5e-5
WITHIN = 0.75
"""Stamps on a grid scatter by half of its unit; what scatters by more was not taken evenly."""

FEW_CHUNKS = 3
"""In so many samples, or chunks, stamps that scatter by chance show how far they do."""

BEHIND_S = 1e-6
"""An irregular sample is out of order when it is stamped by more than this before another."""

UNLIKE = 0.3
STALL_S = 0.75
SEVERAL = 3


class Stamped(StrEnum):
    """When samples get their timestamps, as far as that is declared."""

    UNKNOWN = ""
    AT_SAMPLING = "at_sampling"  # the timestamps are the samples' own times
    WHEN_SENT = "when_sent"  # each is late by a wait that changes


@dataclass(frozen=True, slots=True)
class Sampling:
    """How a regular stream was sampled and stamped. Times are seconds.

    Attributes
    ----------
    period
        Between two samples, while they flowed.
    missing
        Samples that were lost on the way: by the counter, else by steps of whole periods.
    gaps, longest_gap_s
        Interruptions, and the longest.
    disordered
        Samples stamped before one that came earlier.
    rates_hz
        The rate at first and at last, where it changed; else empty.
    noise_s
        By how much stamps scatter about a steady sample clock, at 95 %; 0 where they were taken
        so, or scatter as their grid lets them.
    grid_s
        Unit that stamps are cut or rounded to; 0 where they are not.
    reach_s
        By how much a few neighbouring samples, or chunks, differ from evenly spaced ones.
    late_stamps
        Whether whole chunks are stamped when they are sent: an unknown delay lies in all of them.
    steady
        Whether evening helps: the scatter is the stamps', and the sample clock is steady.
    uncounted
        Whether stamps scatter by so much that single lost samples cannot be counted.
    computed
        Whether stamps within chunks are computed, or closer than samples can be.
    contradicted
        What stamps are by themselves that are declared to be the samples' own times.
    unplaced
        Whether samples may be missing among those stamped late, and nothing tells where.
    received
        How samples waited before they were stamped, or were taken: either may be; None where
        nothing shows that they did.
    shifted
        Where stamps are later, or sooner, from one sample on.
    stalls, longest_stall_s
        How often samples came in a burst after a pause, and the longest delay.
    index
        Which sample each one is, shape ``(n,)``; counts on over those that are missing.
    uneven_s
        By how much stamps scatter about a steady clock, at 95 %, that are taken to be right: as
        samples of an uneven sampler are, and those which are late by delays to both sides alike.
    breaks
        The samples behind holes of which nothing shows how many periods they are.
    unsure_s
        By how much samples near a loss may be off, shape ``(n,)``: which of them came before it is
        not known.
    kept_s
        Scatter of late timestamps, or of those that arrivals show, that could not be dejittered.
    slip_s
        The period, where holes may be polls that were as fast as the sampler.
    shift_s
        By how much all samples may be shifted with no stamp on its grid of polls changed.
    chunk_s
        By how much the middle of a chunk may be beside the sample that its stamps rest on, which
        may be the first or the last: the steps within a chunk are shorter than its samples take.
    unpaused
        Times without the pauses and shifts that are known, in seconds, shape ``(n,)``; None where
        they tell nothing of delays.
    back_s
        By how much the clock of an irregular stream without arrivals may have been set back.
    behind
        Samples of those that lie behind an earlier one.
    """

    period: float = np.nan
    missing: int = 0
    gaps: int = 0
    longest_gap_s: float = 0.0
    disordered: int = 0
    rates_hz: tuple[float, ...] = ()
    noise_s: float = 0.0
    grid_s: float = 0.0
    reach_s: float = 0.0
    late_stamps: bool = False
    steady: bool = False
    uncounted: bool = False
    computed: bool = False
    contradicted: str = ""
    unplaced: bool = False
    received: receipt.Receipt | None = None
    shifted: shifts.Shifts | None = None
    stalls: int = 0
    longest_stall_s: float = 0.0
    index: FloatArray = field(default_factory=lambda: np.empty(0))
    uneven_s: float = 0.0
    breaks: npt.NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    unsure_s: FloatArray | float = 0.0
    back_s: float = 0.0
    kept_s: float = 0.0
    slip_s: float = 0.0
    shift_s: float = 0.0
    chunk_s: float = 0.0
    unpaused: FloatArray | None = None
    behind: int = 0

    @property
    def rate_hz(self) -> float:
        """Samples per second, while they flowed."""
        return 1.0 / self.period

    def as_sampled(self, stamps: FloatArray) -> "Sampling":
        """Return it with stamps that are declared to be the samples' own times.

        A step to later is a pause then, and what scatters are the samples. Of a step back, one of
        both sides is wrong all the same. Where stamps contradict the declaration, it is not used.
        Stamps of a coarse clock keep what it leaves open.
        """
        paused = None if self.shifted is None else self.shifted.without_pauses()
        if (np.diff(stamps) == 0.0).any():
            return replace(self, contradicted="the same for several samples")
        if units.find(stamps):
            return replace(self, shifted=paused, unpaused=None)
        if self.computed:
            return replace(self, contradicted="computed within chunks")
        if self.received is not None:
            return replace(self, contradicted="late by waits, by how they scatter")
        return replace(
            self,
            noise_s=0.0,
            late_stamps=False,
            steady=False,
            unplaced=False,
            shifted=paused,
            uneven_s=0.0,
            unsure_s=0.0,
            slip_s=0.0,
            shift_s=0.0,
            chunk_s=0.0,
            unpaused=None,
        )

    def judged_by(self, moved: FloatArray, *, late: bool = False) -> "Sampling":
        """Return it as steady only if evening moved samples as far as stamping noise scatters.

        Noise is new in each stamp, so that a few neighbours show all of it. What adds up beyond
        that is the sampler's own, as of a camera that takes longer in the dark. What is shown to be
        noise stays noise, as far as neighbours show it, though nothing takes it away.

        Parameters
        ----------
        moved
            By how much, in seconds, shape ``(n,)``.
        late
            Whether all of it is declared to be noise.
        """
        if self.received is not None:
            return self
        by_grid = self.grid_s > 0.0 and not self.noise_s
        allowed = WITHIN * self.grid_s if by_grid else self.reach_s
        if float(np.quantile(np.abs(moved), 0.95)) <= allowed:
            return self
        if late:
            return replace(self, steady=False)
        kept = min(self.noise_s, self.reach_s)
        return replace(
            self, noise_s=0.0, kept_s=kept, late_stamps=False, steady=False, unplaced=False
        )


def examine(
    stamps: FloatArray,
    time: FloatArray,
    arrival: FloatArray | None,
    counter: FloatArray | None,
    *,
    probed: bool = True,
    late: bool = False,
    nominal_s: float = 0.0,
) -> Sampling:
    """Examine one clock's samples of a regular stream.

    Parameters
    ----------
    stamps
        On the source's clock, shape ``(n,)``.
    time
        The same on ours, shape ``(n,)``.
    arrival
        When each sample came, on ours; None when it is not known.
    counter
        The source's own, unwrapped; None when it has none.
    probed
        Whether times rest on probes; those by arrivals scatter for another reason.
    late
        Whether stamps are declared to be late by waits that change.
    nominal_s
        The nominal period, which few samples do not show.
    """
    index = np.arange(len(time), dtype=np.float64) if counter is None else counter
    stalls, longest = _stalls(time, arrival)
    if len(time) < FEW or np.ptp(time) == 0.0:  # or of one stamp, as a packet
        waits = _few_waits(time, index, nominal_s) if late else 0.0
        return Sampling(index=index, noise_s=waits, stalls=stalls, longest_stall_s=longest)
    order = np.argsort(time, kind="stable")
    behind = int(np.count_nonzero(np.diff(np.maximum.accumulate(time)) == 0.0))
    sorted_steps = np.diff(time[order])
    disordered = behind if _is_shuffled(np.diff(time), sorted_steps) else 0
    grid = coarse_unit(stamps, regular=True)
    if disordered:
        counts = index if counter is None else counter[order]  # who has none counts as they stand
        found = _steps(time[order], counts, grid, counted=counter is not None)
    else:
        found = _steps(time, index, grid, counted=counter is not None)
    slips = _slips(found, stamps[order], grid)
    if slips < SEVERAL and not units.are_milliseconds(stamps):
        grid = 0.0  # nothing was cut
    shifted = found.exact and len(found.shifted.at) > 0
    lost, blurred = None, False
    explained = found.computed and not found.missing and not found.clumped
    if probed and not disordered and not grid and not shifted and not explained:
        blurred = counter is None and (found.clumped or not (found.exact or found.computed))
        if blurred:
            find = levels.of_packets if found.clumped else levels.find
            lost = find(time, found.period)
        sure = slice(None)
        if lost is not None:
            index, sure = index + lost.lost, lost.unsure == 0.0
        flowed = time if counter is None else found.flowed
        waited = receipt.find(flowed[sure], index[sure])
        if waited is not None:
            longer = np.diff(index) > 1.5  # noqa: PLR2004
            return Sampling(
                waited.period,
                missing=int((np.diff(index)[longer] - 1.0).sum()),
                gaps=int(np.count_nonzero(longer)),
                longest_gap_s=float(np.diff(time)[longer].max(initial=0.0)),
                noise_s=waited.spread_s,
                late_stamps=True,
                steady=True,
                received=waited,
                stalls=stalls,
                longest_stall_s=longest,
                index=index,
                unsure_s=0.0 if lost is None else lost.unsure * waited.period,
                uncounted=blurred and lost is None,
                computed=found.computed,
                shift_s=receipt.open_shift(flowed, index),
                breaks=found.breaks[: 0 if counter is None else None],
                chunk_s=found.chunk_s,
                unpaused=found.unpaused,
            )
    # Where few slip, no count shows where in their units samples were taken.
    shown = grid if slips >= FEW else 0.0
    noise, late, by_grid, uneven = _noise(time, arrival, found, shown, late=late)
    rates = _rates(found)
    steady = (noise > LEAST_NOISE_S or by_grid) and not disordered and not rates
    unplaced = late and counter is None and (found.clumped or found.missing > 0)
    return Sampling(
        found.period,
        missing=found.missing if lost is None else int(lost.lost[-1]),
        gaps=found.gaps,
        longest_gap_s=found.longest,
        disordered=disordered,
        rates_hz=rates,
        noise_s=noise,
        grid_s=grid,
        reach_s=_reach(found),
        late_stamps=late,
        steady=steady,
        uncounted=blurred and lost is None,
        computed=found.computed,
        unplaced=unplaced,
        shifted=found.shifted,
        stalls=stalls,
        longest_stall_s=longest,
        index=index if disordered else found.index,
        uneven_s=uneven,
        breaks=found.breaks,
        slip_s=found.period if found.slips else 0.0,
        shift_s=receipt.open_shift(found.flowed, found.index) if late else 0.0,
        chunk_s=found.chunk_s,
        unpaused=found.unpaused if probed and not disordered else None,
    )


def examine_irregular(
    stamps: FloatArray,
    time: FloatArray,
    arrival: FloatArray | None,
    counter: FloatArray | None,
) -> Sampling:
    """Examine one clock's samples of an irregular stream, of which no step is expected.

    Parameters
    ----------
    stamps, time, arrival, counter
        As of :func:`examine`.
    """
    index = np.arange(len(time), dtype=np.float64) if counter is None else counter
    behind = time < np.maximum.accumulate(time) - BEHIND_S
    many, grid = len(stamps) >= FEW, 0.0
    if len(stamps) >= SEVERAL:
        grid = coarse_unit(stamps, regular=False) if many else units.usual(stamps)
    parts = np.round(np.diff(stamps) / grid) if grid else np.zeros(1)
    cut = np.count_nonzero(parts != np.median(parts)) >= (SEVERAL if many else 1)
    stalls, longest = _stalls(time, arrival, alone=False)
    back = 0.0 if arrival is not None else _set_back(time)
    return Sampling(
        missing=int(np.maximum(np.diff(index) - 1.0, 0.0).sum()),
        disordered=0 if back else int(np.count_nonzero(behind)),
        behind=int(np.count_nonzero(behind)) if back else 0,
        back_s=back,
        grid_s=grid if cut else 0.0,
        stalls=stalls,
        longest_stall_s=longest,
        index=index,
    )


def _set_back(time: FloatArray) -> float:
    """Return by how much a clock may have been set back, of samples that may come at any time.

    A sample behind an earlier one was sent late, or the clock was set back: by what is seen, and by
    the time since the sample before. Programs that send late do so again and again.
    """
    steps = np.diff(time)
    back = steps < -BEHIND_S
    if not 0 < np.count_nonzero(back) <= SEVERAL:
        return 0.0
    usual = float(np.quantile(steps[~back], 0.95)) if not back.all() else 0.0
    return float(np.sum(usual - steps[back]))


@dataclass(frozen=True, slots=True)
class _Steps:
    """What the steps between neighbouring stamps show."""

    time: FloatArray
    flowed: FloatArray
    unpaused: FloatArray
    breaks: npt.NDArray[np.intp]
    period: float
    local: FloatArray
    index: FloatArray
    missing: int
    gaps: int
    longest: float
    exact: bool
    computed: bool
    clumped: bool
    shifted: shifts.Shifts
    slips: bool
    chunk_s: float


def _steps(time: FloatArray, index: FloatArray, grid: float, *, counted: bool) -> _Steps:
    steps, counts = np.diff(time), np.maximum(np.diff(index), 1.0)
    local = _local(steps / counts)
    typical = _typical(time, index)
    clumped = bool(np.median(local) < CLUMPED * _least(time, index) or not local.min() > 0.0)
    if clumped:
        local = np.full(len(steps), typical)
    whole = counts if counted else np.maximum(np.round(steps / local), 1.0)
    rest = steps - whole * local
    scatter = 1.4826 * float(np.median(np.abs(rest)))
    odd = float((np.abs(rest) > WHOLE * local).mean())
    exact = scatter < EXACT * float(np.median(local)) and odd < 0.01  # noqa: PLR2004
    exact = exact and not _are_polls(whole > counts)
    same, in_chunks = _chunks(steps, counts * local)
    # Steps are computed by one rate, whatever the clock that stamps the chunks does meanwhile.
    one_rate = bool(np.ptp(np.quantile(local, (0.1, 0.9))) < RATE_CHANGE * typical)
    computed = clumped or (not grid and in_chunks and one_rate)
    exact = exact and not computed
    uncounted = steps - (counts - 1.0) * local
    hole = holes.find(uncounted, local, scatter, grid, exact=exact, chunks=computed)
    if counted:
        hole = hole.pauses()
    whole, beyond = counts + hole.lost(len(steps)), hole.beyond(len(steps))
    breaks = hole.at[hole.broken | hole.untold]
    longer = np.isin(np.arange(len(steps)), hole.at[hole.broken]) | counted
    back = np.zeros(len(steps))
    if not computed:
        back = holes.went_back(steps - counts * local, local, typical, scatter)
        breaks = np.union1d(breaks, np.flatnonzero(back)).astype(np.intp)
    known = (longer | (steps < counts * local)) & exact & (not grid)
    shifted = shifts.find(steps - counts * local, local, back, known)
    gaps = np.maximum(whole - 1.0, beyond / local) > holes.LONGER
    missing = int((whole - 1.0).sum())
    position = index if counted else index[0] + np.r_[0.0, np.cumsum(whole)]
    flowed = time - np.r_[0.0, np.cumsum(beyond - back)]
    moved = np.zeros(len(steps))
    moved[shifted.at - 1] = shifted.by_s
    long = beyond + (whole - counts) * local >= wander.MOST_S
    unpaused = time - np.r_[0.0, np.cumsum(np.where(long & (moved == 0.0), beyond, moved))]
    mean, usual = slope(position, flowed), float(np.median(local))
    if computed and not clumped and not counted:
        first = np.r_[0, np.flatnonzero(~same) + 1]
        rest = time[first] - usual * position[first]
        lost, mean = lost_between(position[first], rest, usual)
        if lost:
            before = lost_before(rest, usual)
            position = position + np.repeat(before, np.diff(np.r_[first, len(time)]))
            missing += max(int(before[-1]), 1)
    longest = float(steps[gaps].max(initial=0.0))
    return _Steps(
        time, flowed, unpaused, breaks + 1, mean, local, position, missing, int(gaps.sum()),
        longest, exact, computed, clumped, shifted,
        exact and not counted and hole.may_be_slips(len(steps)),
        0.0 if exact else _half_a_chunk(steps / counts, typical),
    )  # fmt: skip


def _are_polls(longer: npt.NDArray[np.bool_]) -> bool:
    """Return whether longer steps come at even intervals: those are of polls that found nothing."""
    apart = np.diff(np.flatnonzero(longer))
    if len(apart) < FEW_LOST * len(longer):
        return False
    return bool(np.ptp(np.quantile(apart, (0.02, 0.98))) <= 1.0)


def _chunks(steps: FloatArray, usual: FloatArray) -> tuple[npt.NDArray[np.bool_], bool]:
    """Return which steps are usual ones, and whether others part chunks."""
    same = np.abs(steps - usual) < EQUAL_S
    boundary = (steps - usual)[~same]
    if same.mean() <= SAME or len(boundary) < FEW:
        return same, False
    between = boundary / usual[~same]
    fraction = np.abs(between - np.round(between)) > 0.05  # noqa: PLR2004
    # A chunk that waits for longer than the one before comes late, the next one early.
    both_ways = (boundary < -EQUAL_S).mean() > EARLIER
    return same, bool(fraction.mean() > 0.5 and both_ways)  # noqa: PLR2004


def _half_a_chunk(steps: FloatArray, typical: float) -> float:
    """Return by how much half of a chunk is shorter, or longer, by its stamps than its samples.

    Stamps of a chunk are computed from one of them, or all the same; what the steps within chunks
    leave out, or have too much, is in the steps between them.
    """
    usual = float(np.median(steps))
    between = steps[np.abs(steps - usual) > max(EQUAL_S, CLUMPED * (typical - usual))]
    if not FEW <= len(between) < (1.0 - SAME) * len(steps):
        return 0.0
    size = len(steps) / len(between)
    return (size - 1.0) / size * abs(float(np.median(between)) - usual) / 2.0


def _typical(time: FloatArray, index: FloatArray) -> float:
    """Return the usual period over many samples: those of a burst may all be stamped at once."""
    most = min(MANY, len(time) - 1)
    return float(
        np.median((time[most:] - time[:-most]) / np.maximum(index[most:] - index[:-most], 1.0))
    )


def _least(time: FloatArray, index: FloatArray) -> float:
    """Return the usual period while samples flowed: of the shortest of many spans of samples."""
    most = min(SPAN, len(time) - 1)
    spans = (time[most:] - time[:-most]) / np.maximum(index[most:] - index[:-most], 1.0)
    return float(np.quantile(spans, 0.1))


def _local(steps: FloatArray) -> FloatArray:
    """Return the usual step around each, shape of ``steps``: a rate may change."""
    size = max(len(steps) // BLOCKS, 50)
    middle, usual = _medians(steps, max(len(steps) // size, 1))
    mean = float(np.median(usual))
    usual[usual < BURST * mean] = mean
    return np.asarray(np.interp(np.arange(len(steps)), middle, usual))


def _medians(values: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the middles and medians of blocks."""
    blocks = np.array_split(values, count)
    middle = np.cumsum([len(block) for block in blocks]) - len(blocks[0]) / 2
    return middle, np.array([float(np.median(block)) for block in blocks])


def _is_shuffled(steps: FloatArray, in_order: FloatArray) -> bool:
    """Whether samples fall in place when they are put in the order of their stamps."""
    if not (steps < 0.0).any():
        return False
    usual = float(np.median(in_order))
    odd, left = (
        int(np.count_nonzero(np.abs(each - usual) > WHOLE * usual)) for each in (steps, in_order)
    )
    return left < 0.5 * odd


def _rates(found: _Steps) -> tuple[float, ...]:
    """Return the rates at first and at last where they differ by more than stamps scatter."""
    edges = np.linspace(0, len(found.time) - 1, 41).astype(int)
    span = np.diff(found.index[edges])
    if found.computed or (span <= 0).any():
        return ()
    if not (np.diff(found.flowed[edges]) > 0.0).all():  # stamps stood still, or went back
        return ()
    rate = np.diff(found.flowed[edges]) / span
    scatter = 1.4826 * float(np.median(np.abs(np.diff(rate)))) / np.sqrt(2.0)
    ends = [float(np.median(part)) for part in (rate[:4], rate[-4:])]
    mean = float(np.median(rate))
    low, high = np.quantile(rate, (0.05, 0.95))
    if high - low < max(RATE_CHANGE * mean, 8.0 * scatter):
        return ()
    if found.exact or abs(ends[1] - ends[0]) > RATE_CHANGE * mean:
        return 1.0 / ends[0], 1.0 / ends[1]
    return ()


def _noise(
    time: FloatArray, arrival: FloatArray | None, found: _Steps, grid: float, *, late: bool
) -> tuple[float, bool, bool, float]:
    """Return by how much the stamps scatter that were not taken so, and why.

    The second is whether they are late, the third whether only their grid lets them scatter, the
    last by how much those scatter that were taken so, for all that is known.

    Stamps that are declared to be late, computed, of a coarse clock, or unlike the arrivals of
    their samples were not taken when the samples were.
    """
    rest = found.flowed - found.period * (found.index - found.index[0])
    size = max(len(rest) // BLOCKS, 50)
    if found.computed:
        size = max(size, 20 * max(len(rest) // max(_boundaries(found), 1), 1))
    count = max(len(rest) // size, 1)
    middle, medians = _medians(rest, count)
    level = np.interp(np.arange(len(rest)), middle, medians)
    apart = np.abs(rest - level)
    spread = float(np.quantile(apart, 0.95))
    if found.computed or late:
        waits = float(np.quantile(apart, 0.975)) + abs(float(np.mean(rest - level)))
        return waits, True, False, 0.0
    if grid and spread <= WITHIN * grid:
        return 0.0, False, True, 0.0
    if spread < max(LEAST_NOISE_S, 0.005 * found.period):
        return 0.0, False, False, 0.0
    if arrival is not None and len(arrival) == len(rest) and found.time is time:
        own = rest - level
        beside = arrival - time + own  # what arrival does on top of a steady clock
        near = apart < 4.0 * spread
        share = float(own[near] @ (beside - beside.mean())[near]) / float(own[near] @ own[near])
        doubt = float(beside.std()) / (float(own[near].std()) * np.sqrt(near.sum()))
        if share + 3.0 * doubt < 1.0 - UNLIKE and share < UNLIKE:
            return spread, False, False, 0.0
    return 0.0, False, False, spread


def _few_waits(time: FloatArray, index: FloatArray, period: float) -> float:
    """Return how far samples may have waited that are too few to show it; NaN of one or two."""
    if len(time) < FEW_CHUNKS:
        return np.nan
    return FEW_CHUNKS * float(np.ptp(time - period * index))


def _reach(found: _Steps) -> float:
    """Return by how much a few neighbouring samples, or chunks, differ from evenly spaced ones."""
    size = FEW_CHUNKS
    if found.computed:
        steps = np.diff(found.time)
        bursts = bool(np.median(steps) < CLUMPED * np.median(found.local))
        count = int(np.count_nonzero(steps > found.local)) if bursts else _boundaries(found)
        size *= max(len(found.time) // max(count, 1), 1)
    rest = found.flowed - found.period * (found.index - found.index[0])
    whole = len(rest) // size * size
    return (
        float(np.quantile(np.ptp(rest[:whole].reshape(-1, size), axis=1), 0.95)) if whole else 0.0
    )


def _boundaries(found: _Steps) -> int:
    steps = np.diff(found.time)
    return int(np.count_nonzero(np.abs(steps - found.local) > EQUAL_S))


def coarse_unit(stamps: FloatArray, *, regular: bool) -> float:
    """Return the unit of a coarse clock of which stamps are whole ones apart; 0 if there is none.

    Or the ticks that are expressed in it, if these are longer.
    """
    unit = units.find(stamps)
    if not unit:
        return 0.0
    if not regular or len(stamps) < 2:  # noqa: PLR2004
        return units.tick(stamps, unit, 0.0)
    period = _typical(np.sort(stamps), np.arange(float(len(stamps))))
    if abs(unit - period) < RATE_CHANGE * period:  # all steps are of one sample, or of some
        return units.MILLISECOND if units.are_milliseconds(stamps) else 0.0
    return units.tick(stamps, unit, period)


def _slips(found: _Steps, stamps: FloatArray, grid: float) -> int:
    """Return how often stamps are other whole units of a grid apart than their periods are."""
    if not grid:
        return 0
    parts = np.diff(np.round((stamps - stamps[0]) / grid))
    return int(np.count_nonzero(parts != round(found.period / grid) * np.diff(found.index)))


def _stalls(
    time: FloatArray, arrival: FloatArray | None, *, alone: bool = True
) -> tuple[int, float]:
    """Return how often samples came in a burst after a pause, and the longest delay.

    A single sample may be stamped with what happened long ago; ``alone`` says whether it counts.
    """
    if arrival is None or len(time) < 2:  # noqa: PLR2004
        return 0, 0.0
    lag = arrival - time
    usual = float(np.median(lag))
    late = lag > min(usual, float(np.quantile(lag, 0.1)) + 0.5) + STALL_S
    if not alone:  # in a burst, the sooner a sample was taken, the later it comes
        burst = (np.diff(arrival) < np.diff(time)) & late[:-1]
        late &= np.r_[burst, False] | np.r_[False, burst]
    begins = np.flatnonzero(np.diff(np.r_[0, late.astype(int)]) == 1)
    return len(begins), float(lag.max()) if len(begins) else 0.0
