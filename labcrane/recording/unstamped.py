"""Samples without a timestamp: the rest of a chunk in flight when a receiver connected.

LSL sends one timestamp with a chunk, that of its first sample, and a receiver adds a period for
each further sample. A receiver that connects in the middle of a chunk lacks the first timestamp. It
counts from zero, and gives the rest of the chunk the timestamps of one period, two periods, ...
(liblsl, data_receiver.cpp; known there as issue 161). The next chunk has correct timestamps again.
Another recorder that was connected before has the true timestamps of the same samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from labcrane.recording.xdf.samples import Texts
from labcrane.types import FloatArray

JUMP_S = 1.0
"""From a timestamp that was counted from zero to the next; a clock that began at zero continues."""

TOLERANCE = 1e-6
"""Share of a period by which a sum of periods may be off a multiple."""


@dataclass(frozen=True, slots=True)
class Received:
    """A recorder's data of a stream.

    Attributes
    ----------
    stamps
        On the source's clock, in seconds, shape ``(n,)``.
    data
        Shape ``(n, n_channels)``; empty for texts.
    texts
        One tuple per sample; empty for numbers.
    """

    stamps: FloatArray
    data: npt.NDArray[np.generic]
    texts: Texts

    def rows(self, begin: int, end: int) -> list[bytes] | Texts:
        """Return the values of some samples, to be compared to the bit."""
        if self.texts:
            return self.texts[begin:end]
        return [np.ascontiguousarray(row).tobytes() for row in self.data[begin:end]]


def unstamped(stamps: FloatArray, rate_hz: float) -> list[tuple[int, int]]:
    """Return where timestamps are counted from zero: first sample, and the one after the last.

    Parameters
    ----------
    stamps
        As they came, in seconds, shape ``(n,)``.
    rate_hz
        Nominal rate; 0 for a stream without one, whose samples then have the timestamp 0.
    """
    period = 1.0 / rate_hz if rate_hz > 0.0 else 0.0
    slack = TOLERANCE * period
    found: list[tuple[int, int]] = []
    for begin in np.flatnonzero(np.abs(stamps - period) <= slack).tolist():
        if found and begin < found[-1][1]:
            continue
        steps = np.abs(stamps[begin:] - period * np.arange(1, len(stamps) - begin + 1))
        other = steps > TOLERANCE * (period + stamps[begin:])
        end = begin + int(np.argmax(other)) if other.any() else len(stamps)
        if end < len(stamps) and stamps[end] - stamps[end - 1] > JUMP_S:
            found.append((begin, end))
    return found


def stamped(
    mine: Received, rate_hz: float, others: Sequence[Received]
) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Return the timestamps of a stream, with those of samples that came without one.

    They are what another recorder has of the same samples, to the bit; or are worked back from the
    chunk that follows, a period for each sample. Without a nominal rate they stay as they are.

    Returns
    -------
    stamps : ndarray, shape (n,)
        In seconds, on the source's clock.
    estimated : list of (int, int)
        Which of them are worked back: first sample, and the one after the last.
    """
    found = unstamped(mine.stamps, rate_hz)
    if not found:
        return mine.stamps, []
    stamps, estimated = mine.stamps.copy(), []
    for begin, end in found:
        known = next(
            (each for other in others if (each := _told_by(mine, begin, end, other)) is not None),
            None,
        )
        if known is not None:
            stamps[begin:end] = known
        elif rate_hz > 0.0:
            stamps[begin:end] = stamps[end] - np.arange(end - begin, 0, -1) / rate_hz
            estimated.append((begin, end))
    return stamps, estimated


def _told_by(mine: Received, begin: int, end: int, other: Received) -> FloatArray | None:
    """Return another recorder's timestamps of the same samples, before the same next one."""
    rows = mine.rows(begin, end + 1)
    for at in np.flatnonzero(other.stamps == mine.stamps[end]).tolist():
        first = at - (end - begin)
        if first < 0 or other.rows(first, at + 1) != rows:
            continue
        if not np.array_equal(other.stamps[first:at], mine.stamps[begin:end]):
            return other.stamps[first:at]
    return None
