"""Time stamps of other clocks, mapped onto ours after the fact.

The usual way pairs each clock offset with the time it was polled, fits one line through a whole
recording, and is wrong by drift times age, by whatever a clock wanders, and by whole steps. Here,
in this order:

1. split where the clock changed (``epochs``),
2. for each clock, leave out probes with long round trips, and follow the rest by local lines in
   the source's own time (``offset``),
3. for sources that sample evenly and drop nothing, even the stamps (``dejitter``),
4. subtract the stated transport delay and device latency.

Nothing recorded is altered, and nothing here depends on when it runs: it can be repeated for ever.
"""

import itertools
from dataclasses import dataclass, field

import numpy as np

from labcrane.errors import RecordingError
from labcrane.streams.sync.dejitter import Dejitter, even
from labcrane.streams.sync.epochs import REMOTE, Epoch, epochs
from labcrane.streams.sync.offset import OffsetCurve, fit
from labcrane.streams.sync.quality import Basis, Quality, Segment, assess, usual_lag
from labcrane.streams.sync.raw import RawStream
from labcrane.types import FloatArray

WRONG_CLOCK_S = 0.25
"""Samples that seem to travel this much longer than the others were stamped by another clock."""

LONGEST_S = 30.0
"""The first samples cannot be so much older than others: LSL keeps nothing from before."""


@dataclass(frozen=True, slots=True)
class Treatment:
    """How a stream's stamps are to be read.

    Attributes
    ----------
    rate_hz
        Nominal rate; 0 for irregular streams.
    can_drop_samples
        Whether the source may leave out samples, as cameras do.
    dejitter
        For regular streams that drop nothing; markers are never evened.
    transport_s
        Least time from sampling to stamping, for sources stamped when sent. It cannot be observed.
    latency_s
        Stated fixed latency of the device.
    bandwidth_s
        Reach of the smoother of clock offsets.
    """

    rate_hz: float = 0.0
    can_drop_samples: bool = False
    dejitter: Dejitter = Dejitter.LEAST_SQUARES
    transport_s: float = 0.0
    latency_s: float = 0.0
    bandwidth_s: float = 15.0

    @property
    def way(self) -> Dejitter:
        """The dejitter that takes place."""
        if self.rate_hz <= 0.0 or self.can_drop_samples:
            return Dejitter.NONE
        return self.dejitter


_Piece = tuple[int, int, Epoch, OffsetCurve | None]


@dataclass(frozen=True, slots=True)
class Corrected:
    """Times on our clock, shape ``(n,)`` in seconds, and how right they are."""

    time: FloatArray
    segments: tuple[Segment, ...] = field(default_factory=tuple)
    quality: Quality = field(default_factory=Quality)


def correct(raw: RawStream, treatment: Treatment) -> Corrected:
    """Map a stream's stamps onto our clock."""
    if treatment.transport_s and treatment.way is not Dejitter.ENVELOPE:
        raise RecordingError(
            f"a least transport delay of {treatment.transport_s} s needs dejitter 'envelope', "
            "which finds the least delayed samples; give the mean delay as latency otherwise"
        )
    regular = treatment.rate_hz > 0.0
    if not len(raw.stamps):
        return Corrected(np.empty(0), quality=assess(raw, raw.stamps, [], [], regular=regular))
    stretches = epochs(raw, regular=regular)
    curves = _curves(raw, stretches, treatment.bandwidth_s)
    time, segments = _map(raw, stretches, curves, regular=regular)
    index = np.arange(len(time), dtype=np.float64) if raw.index is None else raw.index
    for segment in segments:
        part = slice(segment.start, segment.stop)
        if segment.basis is not Basis.NOTHING:
            time[part] = even(time[part], index[part], treatment.way)
    known = [curve for curve in curves if curve is not None]
    quality = assess(raw, time, segments, known, regular=regular)
    return Corrected(time - treatment.transport_s - treatment.latency_s, tuple(segments), quality)


def _curves(raw: RawStream, stretches: list[Epoch], bandwidth_s: float) -> list[OffsetCurve | None]:
    """Return each clock's curve, the longest known first: it lends its slope to brief ones."""
    curves: list[OffsetCurve | None] = [None] * len(stretches)
    slope = 0.0
    lengths = [
        np.ptp(epoch.probes[:, REMOTE]) if len(epoch.probes) else -1.0 for epoch in stretches
    ]
    for k in sorted(range(len(stretches)), key=lambda k: -lengths[k]):
        epoch = stretches[k]
        if len(epoch.probes):
            stamps = raw.stamps[epoch.start : epoch.stop]
            span = float(stamps.min()), float(stamps.max())
            curve = curves[k] = fit(epoch.probes, bandwidth_s, span, slope)
            slope = slope or curve.slope
    return curves


def _map(
    raw: RawStream, stretches: list[Epoch], curves: list[OffsetCurve | None], *, regular: bool
) -> tuple[FloatArray, list[Segment]]:
    """Return corrected times, and what each stretch of them rests on."""
    arrival = raw.arrival()
    time = np.full(len(raw.stamps), np.nan)
    for epoch, curve in zip(stretches, curves, strict=True):
        if curve is not None:
            part = slice(epoch.start, epoch.stop)
            time[part] = raw.stamps[part] + curve(raw.stamps[part])
    usual = usual_lag(arrival, time)
    found: list[_Piece] = []
    for k, epoch in enumerate(stretches):
        for start, stop in _pieces(raw.stamps, arrival, epoch, regular=regular):
            part = slice(start, stop)
            stamps = raw.stamps[part]
            chosen = curves[k]
            if arrival is not None and (chosen is None or regular):
                after = float(time[start - 1]) if start else float(arrival[0]) - usual - LONGEST_S
                chosen = _whose(stamps, arrival[part], (usual, after), _candidates(curves, k))
            if chosen is None:
                time[part] = _by_arrival(stamps, arrival, part, usual)
            else:
                time[part] = stamps + chosen(stamps)
            found.append((start, stop, epoch, chosen))
    known = arrival is not None
    return time, [_segment(*piece, known=known) for piece in _joined(found)]


def _joined(pieces: list[_Piece]) -> list[_Piece]:
    """Return the pieces with those of one clock put together: what came late is evened alike."""
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

    Not before their time, and in their order. Samples that the network held up come late together.
    """
    usual, after = lag_and_order
    for curve in candidates:
        time = stamps + curve(stamps)
        early = float((arrival - time).min()) < usual - WRONG_CLOCK_S
        if not early and not float(time.min()) < after - WRONG_CLOCK_S:  # after may be NaN
            return curve
    return None


def _pieces(
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
    stamps: FloatArray, arrival: FloatArray | None, part: slice, usual: float
) -> FloatArray:
    """Return times with the offset that makes the samples arrive as late as others do."""
    if arrival is None:
        return np.full(len(stamps), np.nan)
    lag = float(np.median(arrival[part] - stamps))
    return stamps + lag - (0.0 if np.isnan(usual) else usual)


def _segment(
    start: int, stop: int, epoch: Epoch, curve: OffsetCurve | None, *, known: bool
) -> Segment:
    unsure = epoch.unsure if start == epoch.start else 0
    if curve is None:
        return Segment(start, stop, Basis.ARRIVALS if known else Basis.NOTHING, unsure=unsure)
    drift = -curve.slope / (1.0 + curve.slope) * 1e6
    residual = 1.4826 * float(np.median(np.abs(curve.residuals)))
    return Segment(start, stop, Basis.PROBES, len(curve.trusted), unsure, drift, residual)
