"""Epochs of a source's clock: at which probe, and at which sample, it changed.

A source that restarts, or a computer that sleeps, goes on with another clock. Its probes say that,
a second too late; the samples say when.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from labcrane.streams.sync.raw import LOCAL, OFFSET, REMOTE, RTT, RawStream
from labcrane.types import FloatArray

JUMP_S = 0.002
"""Offsets that differ by more than this, and more than probes can err, are two clocks."""

SMALL_S = 0.0003
WALK = 1e-4
ALONE = 0.3
"""Or by these, if the offset goes on before and after as if nothing had been."""

FASTEST_DRIFT = 500e-6
"""No crystal in a computer drifts faster, in seconds per second."""

FASTEST_SLEW = 0.02
"""No system turns its clock by more to set it right."""

CERTAIN_S = 0.1
"""Jumps beyond this show in the times of arrival, whatever the network did."""


FAR_S, EQUALLY_S = 10.0, 1e-3
"""Clocks that differ by more than the first do not share their times; places where they may change
are as good as each other if they differ by less than the second."""

PROBED_S = 5.0
"""LabRecorder asks for an offset as often."""


@dataclass(frozen=True, slots=True)
class Epoch:
    """Samples and probes of one and the same clock.

    Attributes
    ----------
    start, stop
        Range of its samples.
    probes
        Shape ``(n, 4)``, in the order of :class:`~labcrane.streams.probes.Probe`; may be empty.
    unsure
        How many samples at its start may belong to the clock before.
    step_s
        By how much the offset differs from the clock before; 0 where either was not probed.
    told
        Whether liblsl told that the source is another process.
    unheard_s
        For how long its clock was not probed before; 0 where it never was.
    """

    start: int
    stop: int
    probes: FloatArray
    unsure: int = 0
    step_s: float = 0.0
    told: bool = False
    unheard_s: float = 0.0


@dataclass(frozen=True, slots=True)
class _Change:
    """A change of clock: the first probe, the first sample of the new one."""

    probe: int
    sample: int
    unsure: int = 0
    told: bool = False


def epochs(raw: RawStream, *, regular: bool) -> list[Epoch]:
    """Return the stretches of one clock, in order; they cover every sample.

    ``regular`` says that the source samples at a steady rate, so that a step of its clock shows
    between two neighbouring stamps.
    """
    probes = in_order(raw.probes)
    jumps = _jumps(probes)
    probes, jumps = _without_strays(probes, jumps)
    if regular:
        jumps = [k for k in jumps if not _goes_on(raw, probes[k - 1], probes[k])]
    changes = _changes(raw, probes, jumps, regular=regular)
    bounds = [_Change(0, 0), *changes, _Change(len(probes), len(raw.stamps))]
    found = []
    for this, following in itertools.pairwise(bounds):
        mine = probes[this.probe : following.probe]
        if following.sample > this.sample:
            step = _change(probes, this.probe, OFFSET) if len(mine) else 0.0
            unheard = _change(probes, this.probe, LOCAL) if len(mine) else 0.0
            where = this.sample, following.sample
            found.append(Epoch(*where, mine, this.unsure, step, this.told, unheard))
    return found


def _change(probes: FloatArray, k: int, what: int) -> float:
    return float(probes[k, what] - probes[k - 1, what]) if k else 0.0


def in_order(probes: FloatArray) -> FloatArray:
    """Return the probes in the order of their reports, each once."""
    if not len(probes):
        return probes
    ordered = probes[np.argsort(probes[:, LOCAL], kind="stable")]
    new = np.r_[True, np.diff(ordered[:, REMOTE]) != 0.0]
    return np.asarray(ordered[new & np.isfinite(ordered).all(axis=1)])


def _jumps(probes: FloatArray) -> list[int]:
    """Return the probes that cannot be of the clock before.

    The path's asymmetry shifts an offset by up to half the round trip, and no further.
    """
    if len(probes) < 2:  # noqa: PLR2004
        return []
    measured = probes[:, REMOTE] + probes[:, OFFSET]
    drift = FASTEST_DRIFT * np.abs(np.diff(measured))
    doubt = (probes[1:, RTT] + probes[:-1, RTT]) / 2
    change = np.diff(probes[:, OFFSET])
    far = np.abs(change) > JUMP_S + drift + doubt
    far |= _alone(change, np.abs(np.diff(measured)), probes[:, RTT])
    return [int(k) + 1 for k in np.flatnonzero(far)]


def _alone(change: FloatArray, step: FloatArray, trips: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which changes stand alone: small steps, which no clock drifts or is slewed by."""
    if len(change) < 3:  # noqa: PLR2004
        return np.zeros(len(change), dtype=np.bool_)
    usual = float(np.median(change / np.maximum(step, 1e-3)))
    beyond = np.abs(change - usual * step)
    excess = trips - trips.min()
    near = np.pad(beyond, 1)
    around = np.maximum(near[:-2], near[2:])
    clear = beyond > SMALL_S + WALK * step + (excess[1:] + excess[:-1]) / 2.0
    return np.asarray(clear & (around < ALONE * beyond), dtype=np.bool_)


def _without_strays(probes: FloatArray, jumps: list[int]) -> tuple[FloatArray, list[int]]:
    """Leave out single probes whose neighbours agree with each other."""
    strays = [
        k
        for k, following in itertools.pairwise(jumps)
        if following == k + 1 and not _jumps(probes[[k - 1, k + 1]])
    ]
    if not strays:
        return probes, jumps
    kept = np.delete(probes, strays, axis=0)
    return kept, _jumps(kept)


def _changes(
    raw: RawStream, probes: FloatArray, jumps: list[int], *, regular: bool
) -> list[_Change]:
    """Return every change of clock, that liblsl reported or that the probes show."""
    changes = []
    left = set(jumps)
    for told, low, high in raw.resets:
        # A probe under way at the restart may be reported just after it, still of the old clock.
        near = [k for k in left if probes[k - 1, LOCAL] - 1.0 <= told <= probes[k, LOCAL]]
        probe = near[0] if near else int(np.searchsorted(probes[:, LOCAL], told))
        left -= set(near)
        changes.append(_Change(probe, _within(raw, int(low), int(high)), told=True))
    apart = np.abs(np.diff(probes[:, OFFSET]))[[k - 1 for k in left]]
    if not len(raw.arrivals) and not changes and len(raw.stamps) and (apart > FAR_S).any():
        changes, left = _in_their_order(raw.stamps, probes, sorted(left)), set()
    for k in sorted(left):
        sample, unsure = _step(raw, probes[k - 1], probes[k], regular=regular)
        changes.append(_Change(k, sample, unsure))
    firsts = sorted(change.probe for change in changes)
    changes.sort(key=lambda change: change.sample)
    return [replace(change, probe=k) for k, change in zip(firsts, changes, strict=True)]


def _within(raw: RawStream, low: int, high: int) -> int:
    """Return the first sample of a new clock, known to lie in a range."""
    first, last = max(low, 1), min(high, len(raw.stamps) - 1)
    if high <= low or last < first:
        return low
    steps = np.abs(np.diff(raw.stamps[first - 1 : last + 1]))
    return first + int(np.argmax(steps))


def _goes_on(raw: RawStream, before: FloatArray, after: FloatArray) -> bool:
    """Whether stamps go on evenly where a step would show: then the clock was turned faster."""
    step = abs(after[REMOTE] - before[REMOTE])
    if abs(after[OFFSET] - before[OFFSET]) > FASTEST_SLEW * step:
        return False
    low, high = _window(raw, before, after)
    if high <= low or high >= len(raw.stamps):
        return False
    jump = before[OFFSET] - after[OFFSET]
    return _step_between_stamps(raw.stamps, low, high, jump) is None


def _step(
    raw: RawStream, before: FloatArray, after: FloatArray, *, regular: bool
) -> tuple[int, int]:
    """Return the first sample after a step between two probes, and how many may be wrong."""
    low, high = _window(raw, before, after)
    jump = before[OFFSET] - after[OFFSET]
    if high <= low:
        return high, 0
    if regular:
        found = _step_between_stamps(raw.stamps, low, high, jump)
        if found is not None:
            return found
    arrival = raw.arrival()
    if arrival is not None and abs(jump) > CERTAIN_S:
        return _step_in_arrival(raw, arrival, low, high, (before, after)), 0
    middle = (before[REMOTE] + before[OFFSET] + after[REMOTE] + after[OFFSET]) / 2
    old = raw.stamps[low:high] + before[OFFSET] < middle
    return low + int(np.count_nonzero(old)), high - low


def _window(raw: RawStream, before: FloatArray, after: FloatArray) -> tuple[int, int]:
    """Return the range of samples in which the first one after a step may lie."""
    arrival = raw.arrival()
    if arrival is None:
        ends = [before[REMOTE], after[REMOTE]]
        inside = (raw.stamps > min(ends) - 3.0) & (raw.stamps < max(ends) + 3.0)
        where = np.flatnonzero(inside)
        if not len(where):
            return len(raw.stamps), len(raw.stamps)
        return max(int(where[0]), 1), int(where[-1]) + 1
    start = np.searchsorted(arrival, before[REMOTE] + before[OFFSET] - 0.1)
    stop = np.searchsorted(arrival, after[LOCAL] + 3.0)
    return max(int(start), 1), int(stop)


def _step_between_stamps(
    stamps: FloatArray, low: int, high: int, jump: float
) -> tuple[int, int] | None:
    """Return where neighbouring stamps of a steady source differ by a step; None if nowhere."""
    period = float(np.median(np.diff(stamps)))
    odd = np.abs(np.diff(stamps[low - 1 : high]) - period)
    if not len(odd) or odd.max() < abs(jump) / 2:
        return None
    rivals = np.flatnonzero(odd > abs(jump) / 2)
    unsure = int(rivals[-1] - rivals[0])
    return low + int(np.argmax(odd)), unsure


def _in_their_order(stamps: FloatArray, probes: FloatArray, jumps: list[int]) -> list[_Change]:
    """Return where clocks change that are far apart, by the order of the samples alone.

    Each sample is near the times at which its own clock was probed, and none is of an earlier clock
    than the one before. Where several places are as good, stamps that go back tell, as far as
    probes do; no clock goes back but a new one.
    """
    told = [np.diff(one[:, LOCAL]) for one in np.split(probes, jumps)]
    every = 2.0 * max((float(np.median(one)) for one in told if len(one)), default=PROBED_S)
    ranges = [(one.min() - every, one.max() + every) for one in np.split(probes[:, REMOTE], jumps)]
    away = np.array(
        [np.maximum(np.maximum(low - stamps, stamps - high), 0.0) for low, high in ranges]
    )
    total = np.pad(np.cumsum(away, axis=1), ((0, 0), (1, 0)))
    costs = [total[0]]
    for one in total[1:]:
        costs.append(np.minimum.accumulate(costs[-1] - one) + one)
    steps = np.r_[0.0, np.diff(stamps)]
    found: list[_Change] = []
    stop = len(stamps)
    for k in range(len(jumps), 0, -1):
        cost = (costs[k - 1] - total[k])[: stop + 1]
        equal = np.flatnonzero(cost <= cost.min() + EQUALLY_S)
        inside = equal[(equal > 0) & (equal < stop)]
        unsure, sample = 0, int(equal[0])
        if len(inside):
            back = inside[steps[inside] < 0.0]
            likely = back if len(back) else inside
            due = float(probes[jumps[k - 1], REMOTE] - probes[jumps[k - 1] - 1, REMOTE])
            sample = int(likely[np.argmin(np.abs(steps[likely] - due))])
            unsure = 0 if len(back) else int(np.ptp(inside))
        found.append(_Change(jumps[k - 1], sample, unsure))
        stop = sample
    return found[::-1]


def _step_in_arrival(
    raw: RawStream,
    arrival: FloatArray,
    low: int,
    high: int,
    probes: tuple[FloatArray, FloatArray],
) -> int:
    """Return the step that makes the time from stamp to arrival most even."""
    lag = arrival[low:high] - raw.stamps[low:high]
    old, new = (lag - probe[OFFSET] for probe in probes)
    typical = float(np.median(np.minimum(np.abs(old), np.abs(new))))
    cost = np.r_[0.0, np.cumsum(np.abs(old - typical) - np.abs(new - typical))]
    return low + int(np.argmin(cost))
