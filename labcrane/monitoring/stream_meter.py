"""Meter of how a stream comes: its clock, chunks, jitter and gaps, from what has come of late."""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from labcrane.recording.unstamped import Received, stamped
from labcrane.streams.probes import Probe
from labcrane.types import FloatArray

WINDOW_S = 30.0
SKEW_S = 5.0
"""How long probes must have come until the skew is estimated, in seconds."""

FEW_PROBES = 3

GAP = 1.5
"""An interval of more periods is a gap."""


@dataclass(frozen=True, slots=True)
class StreamReading:
    """How a stream comes now; None where it is not known. Seconds, if nothing else is said.

    Attributes
    ----------
    samples
        How many have come since it was begun with.
    rate_hz
        Samples per second by their own timestamps.
    chunk, largest_chunk
        Samples that come at once: the usual number, and the most.
    jitter
        Deviation of the intervals of timestamps from the usual one, 95th percentile.
    gaps, longest_gap
        Intervals of more than one and a half periods, and the longest of them.
    missing
        Samples that the source's own counter left out; None when it has no counter.
    disorder
        Stamps that are not after the one before.
    delay, largest_delay
        From its timestamp to its arrival, on the recorder's clock: median and maximum.
    offset, rtt
        The offset to be added to the source's clock, and the shortest round trip.
    skew_ppm
        How fast its clock runs away, in parts per million.
    silent
        Since the last sample came.
    """

    samples: int
    rate_hz: float | None = None
    chunk: int | None = None
    largest_chunk: int | None = None
    jitter: float | None = None
    gaps: int = 0
    longest_gap: float = 0.0
    missing: int | None = None
    disorder: int = 0
    delay: float | None = None
    largest_delay: float | None = None
    offset: float | None = None
    rtt: float | None = None
    skew_ppm: float | None = None
    silent: float | None = None


class StreamMeter:
    """Takes what comes of one stream, and says how it came in the last half minute.

    Parameters
    ----------
    nominal_hz
        What its header states, 0 for an irregular stream.
    """

    def __init__(self, nominal_hz: float) -> None:
        self._nominal = nominal_hz
        self._chunks: deque[tuple[float, FloatArray]] = deque()
        self._probes: deque[Probe] = deque(maxlen=500)
        self._samples = 0
        self._missing: int | None = None

    def take(self, arrival: float, stamps: FloatArray, missing: int | None = None) -> None:
        """Take samples that came at once, and how many the source's counter left out in them."""
        if missing is not None:
            self._missing = (self._missing or 0) + missing
        if not len(stamps):
            return
        self._samples += len(stamps)
        self._chunks.append((arrival, np.array(stamps, dtype=np.float64)))
        while self._chunks[0][0] < arrival - WINDOW_S:
            self._chunks.popleft()

    def probe(self, probe: Probe) -> None:
        """Take a measurement of the source's clock."""
        self._probes.append(probe)

    def reading(self, now: float) -> StreamReading:
        """Return how it comes at ``now``, on our clock."""
        chunks = list(self._chunks)
        offset, rtt, skew = _clock(list(self._probes))
        if not chunks:
            return StreamReading(
                self._samples, missing=self._missing, offset=offset, rtt=rtt, skew_ppm=skew
            )
        sizes = np.array([len(stamps) for _, stamps in chunks])
        stamps = np.concatenate([each for _, each in chunks])
        stamps, _ = stamped(Received(stamps, np.empty((len(stamps), 0)), []), self._nominal, ())
        arrivals = np.array([arrival for arrival, _ in chunks])
        delays = arrivals - stamps[np.cumsum(sizes) - 1] - (offset or 0.0)
        flow = self._intervals(stamps)
        return StreamReading(
            self._samples,
            rate_hz=flow.rate_hz,
            chunk=int(np.median(sizes)),
            largest_chunk=int(sizes.max()),
            jitter=flow.jitter,
            gaps=flow.gaps,
            longest_gap=flow.longest_gap,
            missing=self._missing,
            disorder=flow.disorder,
            delay=None if offset is None else float(np.median(delays)),
            largest_delay=None if offset is None else float(delays.max()),
            offset=offset,
            rtt=rtt,
            skew_ppm=skew,
            silent=now - chunks[-1][0],
        )

    def _intervals(self, stamps: FloatArray) -> "_Intervals":
        """Return facts about the intervals of timestamps; for irregular streams only the order."""
        steps = np.diff(stamps)
        disorder = int((steps <= 0.0).sum())
        rising = steps[steps > 0.0]
        if self._nominal <= 0.0 or len(rising) < 2:  # noqa: PLR2004 - there is nothing usual yet
            return _Intervals(disorder)
        usual = float(np.median(rising))
        gaps = rising[rising > GAP / self._nominal]
        # One stamp may be late and the next ones early: a gap is what lacks samples in the end.
        jitter = float(np.quantile(np.abs(rising - usual), 0.95))
        if gaps.size and jitter > 0.5 / self._nominal:
            gaps = gaps[gaps > usual + 4.0 * jitter]
        span = float(stamps[-1] - stamps[0])
        return _Intervals(
            disorder,
            (len(stamps) - 1) / span if span > 0.0 else None,
            jitter,
            len(gaps),
            float(gaps.max()) if gaps.size else 0.0,
        )


class _Intervals(NamedTuple):
    """As of :class:`StreamReading`."""

    disorder: int
    rate_hz: float | None = None
    jitter: float | None = None
    gaps: int = 0
    longest_gap: float = 0.0


def _clock(probes: list[Probe]) -> tuple[float | None, float | None, float | None]:
    """Return the current offset, the round-trip time and the skew of a clock, from its probes."""
    if not probes:
        return None, None, None
    times = np.array([probe.local for probe in probes])
    offsets = np.array([probe.offset for probe in probes])
    trips = np.array([probe.rtt for probe in probes])
    skew = None
    if times[-1] - times[0] >= SKEW_S:
        # The quick ones are the right ones; but of few, a line takes three.
        good = trips <= max(2.0 * trips.min(), np.sort(trips)[: min(len(trips), FEW_PROBES)][-1])
        if good.sum() >= FEW_PROBES:
            # Offset is ours minus the source's: a clock that runs fast has a falling one.
            skew = -1e6 * float(np.polyfit(times[good] - times[0], offsets[good], 1)[0])
    return float(offsets[-1]), float(trips.min()), skew
