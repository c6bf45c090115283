"""Union of what two recorders wrote of one stream: every sample once, in order.

LSL sends every receiver the samples of a stream in one order, from when it connects until it dies.
So what two recorders have are two subsequences of one sequence. A sample is known again by its
stamp and its values, to the bit; where these repeat, by its neighbours.

Two write because a spare that had yet to connect lost samples. A ring in shared memory would lose
those that come while no recorder is connected.
"""

import bisect
import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.recording.xdf.samples import Texts
from labcrane.types import FloatArray

IntArray = npt.NDArray[np.int64]
Keys = npt.NDArray[np.uint64]

SHORT = 64
"""Stretches of at most so many samples, none of them unique, are compared one by one."""

_ODD = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, slots=True)
class Union:
    """Where the samples of two recordings are in their union.

    Attributes
    ----------
    first, second
        The place of each sample of either, ascending, shapes ``(n_first,)`` and ``(n_second,)``.
    size
        How many samples there are in all.
    """

    first: IntArray
    second: IntArray
    size: int

    @property
    def shared(self) -> int:
        """How many samples both have."""
        return len(self.first) + len(self.second) - self.size

    def as_they_came(self, first: FloatArray, second: FloatArray) -> "Union":
        """Return the union in which samples that only one has are in the order of their arrival.

        Parameters
        ----------
        first, second
            When each sample of either came, in seconds.
        """
        whose = np.zeros(self.size, np.int64)
        whose[self.first] += 1
        whose[self.second] += 2
        ends = np.flatnonzero(np.diff(whose)) + 1
        places = [self.first.copy(), self.second.copy()]
        for a, b, c in zip(np.r_[0, ends], ends, np.r_[ends, self.size][1:], strict=False):
            if (whose[a], whose[b]) != (1, 2):
                continue
            here, there = np.searchsorted(self.first, (a, b)), np.searchsorted(self.second, (b, c))
            if second[there[1] - 1] < first[here[0]]:
                places[0][slice(*here)] += c - b
                places[1][slice(*there)] -= b - a
        return Union(places[0], places[1], self.size)


def sample_keys(stamps: FloatArray, data: npt.NDArray[np.generic], texts: Texts) -> Keys:
    """Return 64 bits for each sample, made of the bits of its stamp and of its values.

    Two samples of a stream of a million that differ have the same key with a probability of 1e-7.
    """
    keys = _mixed(np.ascontiguousarray(stamps, np.float64).view(np.uint64))
    if texts:
        digests = b"".join(
            hashlib.blake2b("\0".join(row).encode(), digest_size=8).digest() for row in texts
        )
        return _mixed(keys ^ np.frombuffer(digests, np.uint64))
    for column in range(data.shape[1] if data.ndim > 1 else 0):
        values = np.ascontiguousarray(data[:, column])
        keys = _mixed(keys ^ values.view(f"u{values.itemsize}").astype(np.uint64))
    return keys


def _mixed(keys: Keys) -> Keys:
    """Spread every bit over all of them (splitmix64; Steele et al. 2014)."""
    keys = keys + _ODD
    keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return keys ^ (keys >> np.uint64(31))


def union(first: Keys, second: Keys) -> Union:
    """Return the union of two recordings of one sequence.

    Samples that only one has stand between the shared ones they were recorded between; where both
    have some there, those of the first come first.
    """
    pairs = _matched(first, second)
    # Every shared sample lets one place be saved; a sample comes after all that the other has
    # up to the shared one before it, and those of the second also after the first's up to the next.
    mine, theirs = pairs.T
    shared_before = np.searchsorted(mine, np.arange(len(first)), side="left")
    of_second = np.r_[-1, theirs][shared_before] + 1  # of the second, up to the last shared one
    is_shared = np.zeros(len(first), bool)
    is_shared[mine] = True
    of_second[is_shared] = theirs
    in_first = np.arange(len(first)) + of_second - shared_before
    shared_before = np.searchsorted(theirs, np.arange(len(second)), side="left")
    of_first = np.r_[mine, len(first)][shared_before]  # of the first, up to the next shared one
    in_second = np.arange(len(second)) + of_first - shared_before
    return Union(in_first, in_second, len(first) + len(second) - len(pairs))


def _matched(first: Keys, second: Keys) -> IntArray:
    """Return which samples of both are the same one, shape ``(n, 2)``, ascending in both."""
    found: list[IntArray] = []
    stretches = [(0, len(first), 0, len(second))]
    while stretches:
        a, b, c, d = stretches.pop()
        same = _equal_ahead(first[a:b], second[c:d])
        found.append(_run(a, c, same))
        a, c = a + same, c + same
        same = _equal_ahead(first[a:b][::-1], second[c:d][::-1])
        b, d = b - same, d - same
        found.append(_run(b, d, same))
        if a == b or c == d:
            continue
        anchors = _anchors(first[a:b], second[c:d]) + np.array((a, c))
        if not len(anchors):
            found.append(_compared(first[a:b], second[c:d]) + np.array((a, c)))
            continue
        found.append(anchors)
        starts = np.vstack([(a, c), anchors + 1])
        stops = np.vstack([anchors, (b, d)])
        open_ = (starts < stops).all(axis=1)
        stretches += [
            (int(i), int(j), int(k), int(m))
            for (i, k), (j, m) in zip(starts[open_], stops[open_], strict=True)
        ]
    pairs = np.concatenate(found)
    return pairs[np.argsort(pairs[:, 0])]


def _run(start: int, other: int, size: int) -> IntArray:
    steps = np.arange(size)
    return np.column_stack([start + steps, other + steps])


def _equal_ahead(first: Keys, second: Keys) -> int:
    """Return with how many equal keys both begin."""
    size = min(len(first), len(second))
    differ = first[:size] != second[:size]
    return int(np.argmax(differ)) if differ.any() else size


def _anchors(first: Keys, second: Keys) -> IntArray:
    """Return the samples that each has once: the most that are in one order in both."""
    keys, places = _once(first)
    others, other_places = _once(second)
    _, i, j = np.intersect1d(keys, others, assume_unique=True, return_indices=True)
    pairs = np.column_stack([places[i], other_places[j]])
    pairs = pairs[np.argsort(pairs[:, 0])]
    if (np.diff(pairs[:, 1]) > 0).all():
        return pairs
    return pairs[_ascending(pairs[:, 1].tolist())]


def _once(keys: Keys) -> tuple[Keys, IntArray]:
    """Return the keys that are there once, and where."""
    values, places, counts = np.unique(keys, return_index=True, return_counts=True)
    return values[counts == 1], places[counts == 1]


def _ascending(places: list[int]) -> list[int]:
    """Return the indices of the longest ascending subsequence (Fredman 1975)."""
    tails: list[int] = []
    ends: list[int] = []
    before: list[int] = []
    for at, place in enumerate(places):
        length = bisect.bisect_left(tails, place)
        before.append(ends[length - 1] if length else -1)
        if length == len(tails):
            tails.append(place)
            ends.append(at)
        else:
            tails[length], ends[length] = place, at
    chain = []
    at = ends[-1]
    while at >= 0:
        chain.append(at)
        at = before[at]
    return chain[::-1]


def _compared(first: Keys, second: Keys) -> IntArray:
    """Return the longest common subsequence of two stretches without a unique sample.

    Of long ones, the longest run with which the first ends and the second begins: one took over.
    """
    if max(len(first), len(second)) > SHORT:
        sizes = range(min(len(first), len(second)), 0, -1)
        size = next((n for n in sizes if np.array_equal(first[-n:], second[:n])), 0)
        return _run(len(first) - size, 0, size)
    lengths = np.zeros((len(first) + 1, len(second) + 1), np.int64)
    for i in range(len(first) - 1, -1, -1):
        for j in range(len(second) - 1, -1, -1):
            longest = max(lengths[i + 1, j], lengths[i, j + 1])
            lengths[i, j] = lengths[i + 1, j + 1] + 1 if first[i] == second[j] else longest
    found: list[tuple[int, int]] = []
    i = j = 0
    while i < len(first) and j < len(second):
        if first[i] == second[j]:
            found.append((i, j))
            i, j = i + 1, j + 1
        elif lengths[i + 1, j] >= lengths[i, j + 1]:
            i += 1
        else:
            j += 1
    return np.array(found, np.int64).reshape(-1, 2)
