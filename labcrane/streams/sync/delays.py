"""Delays of a regular stream: by how much they may have changed over all clocks of its source.

A step of the source's clock leaves its sampler and its way alone. What changed before it is as open
behind it, so that both sides are compared.
"""

import itertools
from dataclasses import replace

import numpy as np

from labcrane.streams.sync.quality import ClockSegment
from labcrane.streams.sync.sampling import Sampling
from labcrane.streams.sync.stamping import wander
from labcrane.streams.sync.stamping.shifts import MOST_S, Shifts
from labcrane.types import FloatArray

HALF = 0.5
"""Two shifts make each other good where less than this part of one remains."""

UNLIKE = 0.02
"""No delay that changes lets periods differ by more: then one part counts polls, not samples."""

Part = tuple[ClockSegment, Sampling]


def changes(
    stamps: FloatArray, time: FloatArray, parts: list[Part], *, lossless: bool, counted: bool
) -> FloatArray:
    """Return by how much each sample's delay may differ from that of any other, shape ``(n,)``.

    Parameters
    ----------
    stamps, time
        On the source's clock, and the same on ours before dejittering, in seconds, shape ``(n,)``.
    parts
        The stretches of one clock, in order, and how each was sampled.
    lossless
        Whether samples are only missing where that is seen: otherwise a long step is not a delay.
    counted
        Whether the source has a counter.
    """
    found = np.zeros(len(time))
    for joined in _runs(time, parts, counted=counted):
        run = _made_good(time, joined, counted=counted)
        whole = slice(run[0][0].start, run[-1][0].stop)
        found[whole] = _shifts(run).open_s(whole.stop - whole.start)
        if lossless and run[0][1].unpaused is not None:
            found[whole] += _wander(stamps, time, run, counted=counted)
    return found


def _runs(time: FloatArray, parts: list[Part], *, counted: bool) -> list[list[Part]]:
    """Return the parts by run: one sampler goes on in each of them, without a pause between."""
    runs: list[list[Part]] = []
    for after in parts:
        if runs and _goes_on(time, runs[-1][-1], after, counted=counted):
            runs[-1].append(after)
        else:
            runs.append([after])
    return runs


def _goes_on(time: FloatArray, before: Part, after: Part, *, counted: bool) -> bool:
    """Return whether a sampler goes on: no pause, nor a restart, is as short as a delay."""
    (part, one), (following, other) = before, after
    if part.stop != following.start or (one.unpaused is None) != (other.unpaused is None):
        return False
    shifts = [np.abs(each.shifted.by_s) for each in (one, other) if each.shifted is not None]
    if any((each >= MOST_S).any() for each in shifts):  # no delay: a clock was set
        return False
    return abs(_late(time, before, after, counted=counted)) < MOST_S


def _late(time: FloatArray, before: Part, after: Part, *, counted: bool) -> float:
    """Return by how much the first sample of a part is later than the count says."""
    (part, one), (following, other) = before, after
    samples = float(other.index[0] - one.index[-1]) if counted else 1.0
    return float(time[following.start] - time[part.stop - 1] - samples * other.period)


def _made_good(time: FloatArray, run: list[Part], *, counted: bool) -> list[Part]:
    """Return the parts without the shifts that a join makes good.

    Where a step is put beside its sample, those between are shifted, and those behind are not.
    """
    lates = [_late(time, *both, counted=counted) for both in itertools.pairwise(run)]
    found = []
    for k, (part, one) in enumerate(run):
        if one.shifted is None or one.unpaused is None:
            found.append((part, one))
            continue
        at, by_s = one.shifted.at, one.shifted.by_s
        good = np.zeros(len(at), dtype=np.bool_)
        for late in lates[max(k - 1, 0) : k + 1]:
            good |= np.abs(by_s + late) < HALF * np.abs(by_s)
        back = np.zeros(len(one.unpaused))
        np.add.at(back, at[good], by_s[good])
        kept = Shifts(at[~good], by_s[~good])
        found.append((part, replace(one, shifted=kept, unpaused=one.unpaused + np.cumsum(back))))
    return found


def _shifts(run: list[Part]) -> Shifts:
    """Return the shifts of all parts, counted from the first sample of the run."""
    each = [(part.start, one.shifted) for part, one in run if one.shifted is not None]
    return Shifts(
        np.concatenate(
            [np.empty(0, np.intp), *(start - run[0][0].start + one.at for start, one in each)]
        ),
        np.concatenate([np.empty(0), *(one.by_s for _, one in each)]),
    )


def _wander(stamps: FloatArray, time: FloatArray, run: list[Part], *, counted: bool) -> FloatArray:
    """Return how the level of stamps changes on both clocks: one of them may be slewed."""
    period = max(run, key=lambda each: each[0].stop - each[0].start)[1].period
    index, ours, drifted = [], [], []
    paused, drift, last = 0.0, 0.0, -1.0
    for part, one in run:
        here = slice(part.start, part.stop)
        unpaused = time[here] if one.unpaused is None else one.unpaused
        ours.append(unpaused - paused)
        paused += float(time[part.stop - 1] - unpaused[-1])
        own = stamps[here] - time[here]
        drifted.append(own - own[0] + drift)
        drift = float(drifted[-1][-1])
        unit = one.period / period if abs(one.period / period - 1.0) > UNLIKE else 1.0
        index.append(one.index if counted else unit * (one.index - one.index[0]) + last + 1.0)
        last = float(index[-1][-1])
    flow, count = np.concatenate(ours), np.concatenate(index)
    levels = (wander.find(each, count, period) for each in (flow, flow + np.concatenate(drifted)))
    return np.asarray(np.minimum(*levels))
