"""A stream as it was received, before anything is made of its time stamps."""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import RESET, RecordedStream
from labcrane.types import FloatArray

POLL_AGE_S = 1.2
"""LabRecorder pairs an offset with the time when it asks for it; liblsl measured it 0.2 to 2.2 s
before."""

ASSUMED_RTT_S = 1e-3
"""Round trip of a probe that was recorded without: few cables need longer."""


FEW_ANSWERS = 5

REMOTE, OFFSET, RTT, LOCAL = range(4)
"""Columns of probes."""


def _nothing(columns: int) -> FloatArray:
    return np.empty((0, columns))


@dataclass(frozen=True, slots=True)
class RawStream:
    """What a recorder keeps of a stream's times. Times are seconds; nothing in it is altered.

    Attributes
    ----------
    stamps
        Time stamps on the source's clock, shape ``(n,)``, in the order of arrival.
    probes
        Clock probes, shape ``(n_probes, 4)``: the source's time at the probe, what must be added to
        its clock to have ours, the probe's round trip, and our time when liblsl reported it.
    arrivals
        Shape ``(n_chunks, 2)``: samples received so far, our time at that moment.
    resets
        Shape ``(n_resets, 3)``: our time when liblsl told that the source is another process, and
        the range of samples in which the first one of the new process lies, ends included.
    index
        The source's own sample counter, unwrapped, shape ``(n,)``; None when it has none.
    own_probes
        Those that its own program answered, where ``probes`` are all of its computer's, shape
        ``(n_own, 4)``; else None.
    """

    stamps: FloatArray
    probes: FloatArray = field(default_factory=lambda: _nothing(4))
    arrivals: FloatArray = field(default_factory=lambda: _nothing(2))
    resets: FloatArray = field(default_factory=lambda: _nothing(3))
    index: FloatArray | None = None
    own_probes: FloatArray | None = None

    def __post_init__(self) -> None:
        for name, columns in (("probes", 4), ("arrivals", 2), ("resets", 3)):
            shape = getattr(self, name).shape
            if len(shape) != 2 or shape[1] != columns:  # noqa: PLR2004
                raise RecordingError(f"{name} must have the shape (n, {columns}), but have {shape}")

    def arrival(self) -> FloatArray | None:
        """Return our time when each sample arrived, shape ``(n,)``; None when that is not known."""
        if not len(self.arrivals):
            return None
        counts, times = self.arrivals.T
        chunk = np.searchsorted(counts, np.arange(len(self.stamps)), side="right")
        return np.asarray(times[np.minimum(chunk, len(times) - 1)])

    def answers_until(self) -> float:
        """Return until when its program is known to answer, on our clock; infinity if it may yet.

        Answers come at intervals, and some are lost: until twice the longest pause of them.
        """
        answered = self.probes if self.own_probes is None else self.own_probes
        told = np.sort(answered[:, LOCAL])
        if len(told) < FEW_ANSWERS:
            return np.inf
        return float(told[-1] + 2.0 * np.diff(told).max())

    def only(self, own: npt.NDArray[np.bool_]) -> "RawStream":
        """Return the stream of these samples alone."""
        before = np.r_[0, np.cumsum(own)]
        arrivals, resets = self.arrivals.copy(), self.resets.copy()
        if len(arrivals):
            arrivals[:, 0] = before[np.clip(arrivals[:, 0].astype(int), 0, len(own))]
        if len(resets):
            resets[:, 1:] = before[np.clip(resets[:, 1:].astype(int), 0, len(own))]
        return replace(
            self,
            stamps=self.stamps[own],
            arrivals=arrivals,
            resets=resets,
            index=None if self.index is None else self.index[own],
        )


def unwrapped(counts: FloatArray) -> FloatArray | None:
    """Return a source's counter without its wraps, shape ``(n,)``; None when it does not count.

    A counter goes on by one nearly always. A step back is a wrap, to the power of two that the
    highest number falls just short of, else to that number itself.
    """
    steps = np.diff(counts)
    if len(steps) == 0 or float(np.median(steps)) != 1.0 or not np.isfinite(counts).all():
        return None
    back = steps < 0.0
    if back.any():
        highest = float(counts.max()) + 1.0
        power = 2.0 ** np.ceil(np.log2(highest))
        steps = np.where(back, steps + (power if highest > 0.98 * power else highest), steps)
    return np.asarray(np.r_[0.0, np.cumsum(np.maximum(steps, 0.0))])


def raw_of(recorded: RecordedStream) -> RawStream:
    """Return the times of a recorded stream, for correction.

    Parameters
    ----------
    recorded
        As read from journals of labcrane or of another recorder, whose clock offsets count as
        probes of :data:`POLL_AGE_S` before, with round trips that nobody wrote down.
    """
    probes = recorded.probes
    if not len(probes) and len(recorded.offsets):
        when, offset = recorded.offsets.T
        trips = np.full(len(when), ASSUMED_RTT_S)
        probes = np.column_stack([when - POLL_AGE_S, offset, trips, when + offset])
    return RawStream(
        recorded.time_raw,
        probes=probes,
        arrivals=recorded.arrivals,
        resets=_resets(recorded),
    )


def _resets(recorded: RecordedStream) -> FloatArray:
    """Return when the source was replaced, and among which samples of the whole stream."""
    found = [
        [note.time, *map(float, note.data["samples"])]
        for note in recorded.notes
        if note.data.get("event") == RESET
    ]
    return np.array(found, dtype=np.float64).reshape(-1, 3)
