"""Time stamps of other clocks, mapped onto ours after the fact.

The usual way pairs each clock offset with the time it was polled, fits one line through a whole
recording, and is wrong by drift times age, by whatever a clock wanders, and by whole steps. Here,
in this order:

1. split where the clock changed (``epochs``),
2. for each clock, follow its probes in the source's own time, each trusted by its round trip
   (``offset``, ``smoother``), and place its samples (``placement``),
3. see how it sampled and stamped (``sampling``), and even the stamps only where that is shown to
   help (``dejitter``),
4. subtract the stated transport delay and device latency.

Each step adds what it leaves open to the uncertainty of every sample.

Nothing recorded is altered, and nothing here depends on when it runs: it can be repeated for ever.
"""

import itertools
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane.errors import RecordingError
from labcrane.streams.sync.dejitter import Dejitter, even, even_line, follow_sample_clock, left_open
from labcrane.streams.sync.delays import changes
from labcrane.streams.sync.epochs import epochs
from labcrane.streams.sync.placement import LATE_S, PULL_S, Placement, moving, place
from labcrane.streams.sync.quality import (
    Basis,
    ClockSegment,
    Quality,
    clock_changes,
    probe_age,
    worst_second,
)
from labcrane.streams.sync.raw import REMOTE, RTT, RawStream
from labcrane.streams.sync.sampling import (
    RATE_CHANGE,
    Sampling,
    Stamped,
    examine,
    examine_irregular,
)
from labcrane.streams.sync.terms import Term, Terms, none_of, total, typical
from labcrane.types import FloatArray


@dataclass(frozen=True, slots=True)
class Treatment:
    """How a stream's stamps are to be read.

    Attributes
    ----------
    rate_hz
        Nominal rate; 0 for irregular streams.
    can_drop_samples
        Whether the source may leave out samples, as cameras do.
    stamped
        When samples of a regular stream get their stamps, as far as that is declared.
    dejitter
        Whether timestamps are dejittered; markers never are, nor streams that may drop samples.
    transport_s
        Least time from sampling to stamping, for sources stamped when sent. It cannot be observed.
    latency_s
        Stated fixed latency of the device.
    """

    rate_hz: float = 0.0
    can_drop_samples: bool = False
    stamped: Stamped = Stamped.UNKNOWN
    dejitter: Dejitter = Dejitter.AUTO
    transport_s: float = 0.0
    latency_s: float = 0.0

    @property
    def way(self) -> Dejitter:
        """The dejitter that takes place."""
        if self.rate_hz <= 0.0 or self.can_drop_samples:
            return Dejitter.NONE
        return self.dejitter


PAUSE_S = 0.5

BACK_S = 0.001
"""By more than this a sample is placed before one that came earlier."""

NEARLY_ALL = 1.35
"""Of what scatters by chance, 99 % are within so many times what 95 % are within."""

STANDING = 20
"""So many stamps of markers that are all the same say nothing."""

TWICE = 2.0
"""A mean that is declared may be wrong for a while by so many times the change that is seen."""

LONG_RUN = 400
"""So many samples between holes tell a steady clock of them."""

ENOUGH = 2000
"""So many samples tell a rate well enough to see it change from one clock to the next."""

_Followed = tuple[FloatArray, FloatArray]
_Sampled = tuple[ClockSegment, Sampling, _Followed | None]


@dataclass(frozen=True, slots=True)
class Corrected:
    """Times on our clock, and how right they are.

    Attributes
    ----------
    time
        In seconds, shape ``(n,)``; NaN where nothing is known.
    terms
        Why each may be off, and by how much: :class:`~labcrane.streams.sync.terms.Term`.
    uneven
        The times as they are without evening, in seconds, shape ``(n,)``.
    segments
        Stretches of one clock, and what each rests on.
    quality
        The same summed up.
    """

    time: FloatArray
    terms: Terms
    uneven: FloatArray
    segments: tuple[ClockSegment, ...] = field(default_factory=tuple)
    quality: Quality = field(default_factory=Quality)

    @property
    def error(self) -> FloatArray:
        """How far each may be off at 95 %, in seconds, shape ``(n,)``: the sum of its terms."""
        return total(self.terms)

    @property
    def basis(self) -> npt.NDArray[np.uint8]:
        """What each sample's time rests on, shape ``(n,)``: place in :class:`Basis`."""
        order = list(Basis)
        found = np.full(len(self.time), order.index(Basis.NOTHING), dtype=np.uint8)
        for segment in self.segments:
            found[segment.start : segment.stop] = order.index(segment.basis)
        return found


def correct(raw: RawStream, treatment: Treatment, end: float | None = None) -> Corrected:
    """Map a stream's stamps onto our clock.

    Parameters
    ----------
    end
        When the recording ended, on our clock, if that is known: a source may have died before.
    """
    if treatment.transport_s and treatment.way is not Dejitter.ENVELOPE:
        raise RecordingError(
            f"a least transport delay of {treatment.transport_s} s needs dejitter 'envelope', "
            "which finds the least delayed samples; give the mean delay as latency otherwise"
        )
    told = np.isfinite(raw.stamps)
    least = 2 if treatment.rate_hz > 0.0 else STANDING  # markers may come two at once
    if np.count_nonzero(told) >= least and np.ptp(raw.stamps[told]) == 0.0:
        told[:] = False
    if not told.all():
        return _some_untold(raw, treatment, end, told)
    return _correct(raw, treatment, end)


MISSING_S = 1.0
"""Frames that are further apart, and by more than three usual steps, have a gap between them."""


def as_stated(raw: RawStream, terms: Terms, end: float | None) -> Corrected:
    """Return the times of our own processes: on our clock already, with a stated uncertainty.

    They are on this computer and convert a device's stamps themselves: neither probes nor arrivals
    tell more. An error is NaN where one of its terms is unknown.
    """
    time = raw.stamps
    silent = end - float(time[-1]) if end is not None and len(time) else 0.0
    steps = np.diff(time)
    gaps = steps[steps > max(MISSING_S, 3.0 * float(np.median(steps)))] if len(steps) else steps
    quality = Quality(
        silent_s=silent,
        gaps=len(gaps),
        longest_gap_s=float(gaps.max(initial=0.0)),
        restarts=len(raw.resets),
        **_errors(time, terms, time),
    )
    return Corrected(time, terms, time, quality=quality)


def _some_untold(
    raw: RawStream, treatment: Treatment, end: float | None, told: npt.NDArray[np.bool_]
) -> Corrected:
    """Correct a stream of which some stamps, or all, say nothing: none, or the same for ever.

    Those samples are placed by their arrival, which is all that is known of them.
    """
    found = correct(raw.only(told), treatment, end)
    arrival, count = raw.arrival(), len(raw.stamps)
    time, uneven = (np.full(count, np.nan) for _ in range(2))
    terms = {name: np.zeros(count) for name in found.terms}
    terms[Term.CLOCK][~told] = np.nan if arrival is None else PULL_S + LATE_S
    where = np.r_[np.flatnonzero(told), count]
    segments = tuple(
        replace(each, start=int(where[each.start]), stop=int(where[each.stop]))
        for each in found.segments
    )
    if arrival is not None:
        time[~told] = uneven[~told] = arrival[~told] - treatment.latency_s
    if not told.any():
        basis = Basis.NOTHING if arrival is None else Basis.ARRIVALS
        segments = (ClockSegment(0, count, basis, unsure=0),)
    time[told], uneven[told] = found.time, found.uneven
    for name, term in found.terms.items():
        terms[name][told] = term
    frozen = int(np.count_nonzero(np.isfinite(raw.stamps[~told])))
    quality = replace(
        found.quality,
        unprobed=found.quality.unprobed + int(np.count_nonzero(~told)),
        frozen=found.quality.frozen + frozen,
        **_errors(time, terms, uneven),
    )
    return Corrected(time, terms, uneven, segments, quality)


def _correct(raw: RawStream, treatment: Treatment, end: float | None) -> Corrected:
    if not len(raw.stamps):
        nothing = np.empty(0)
        return Corrected(nothing, none_of(0), nothing, quality=Quality(**_trips(raw)))
    regular = treatment.rate_hz > 0.0
    placed = place(raw, epochs(raw, regular=regular), regular=regular)
    sampled = _examined(raw, placed, treatment)
    time, terms = _evened(raw, placed, sampled, treatment)
    shift = treatment.transport_s + treatment.latency_s
    quality = _summed(raw, placed, sampled, (time, terms, end), regular=regular)
    if regular and treatment.stamped:
        against = next((one.contradicted for _, one, _ in sampled if one.contradicted), "")
        quality = replace(quality, stamped=treatment.stamped.value, contradicted=against)
    return Corrected(time - shift, terms, placed.time - shift, placed.segments, quality)


def _examined(raw: RawStream, placed: Placement, treatment: Treatment) -> list[_Sampled]:
    """Return how each clock's samples were sampled, and their even times where these help."""
    arrival, times = raw.arrival(), placed.time
    regular, stamped = treatment.rate_hz > 0.0, treatment.stamped
    if placed.long_frozen:  # frozen timestamps do not show how samples were taken
        own = moving(raw.stamps)
        times = np.interp(np.arange(len(times)), own, times[own])
    found: list[_Sampled] = []
    for segment in placed.segments:
        part = slice(segment.start, segment.stop)
        if segment.basis is not Basis.NOTHING:
            seen = (
                raw.stamps[part],
                times[part],
                None if arrival is None else arrival[part],
                None if raw.index is None else raw.index[part],
            )
            probed = segment.basis is Basis.PROBES
            if regular:
                late = stamped is Stamped.WHEN_SENT
                period = 1.0 / treatment.rate_hz
                sampling = examine(*seen, probed=probed, late=late, nominal_s=period)
            else:
                sampling = examine_irregular(*seen)
            if stamped is Stamped.AT_SAMPLING:
                sampling = sampling.as_sampled(raw.stamps[part])
            followed = None
            if sampling.steady:
                followed = _followed(times[part], sampling)
                moved = times[part] - followed[0]
                sampling = sampling.judged_by(moved, late=stamped is Stamped.WHEN_SENT)
            found.append((segment, sampling, followed if sampling.steady else None))
    return found


def _followed(time: FloatArray, sampling: Sampling) -> _Followed:
    """Return even times and their error; those that polls stamped lie on straight lines.

    A phase that slides along the grid of polls is none of the sampler's.
    """
    received = sampling.received
    dejittered, doubt = time.copy(), np.full(len(time), sampling.noise_s)
    for start, stop in itertools.pairwise((0, *sampling.breaks, len(time))):
        if stop - start >= LONG_RUN:  # the length of a hole is not dejittered
            run = time[start:stop], sampling.index[start:stop]
            dejittered[start:stop], doubt[start:stop] = follow_sample_clock(*run)
            if received is not None and received.polled:
                dejittered[start:stop], doubt[start:stop] = even_line(*run), received.strayed_s
    return dejittered, doubt


def _evened(
    raw: RawStream, placed: Placement, sampled: list[_Sampled], treatment: Treatment
) -> tuple[FloatArray, Terms]:
    """Return times, dejittered where that helps or is requested, and why they may be off."""
    time, way = placed.time.copy(), treatment.way
    terms = {name: term + placed.terms.get(name, 0.0) for name, term in none_of(len(time)).items()}
    declared = treatment.transport_s != 0.0 or treatment.latency_s != 0.0
    counted = raw.index is not None
    delays = changes(
        raw.stamps,
        placed.time,
        [(segment, sampling) for segment, sampling, _ in sampled],
        lossless=counted or not treatment.can_drop_samples,
        counted=counted,
    )
    for segment, sampling, followed in sampled:
        part = slice(segment.start, segment.stop)
        # Nothing tells cut stamps from rounded ones, and so whether they are half a unit early.
        stamps: FloatArray | float = sampling.grid_s / 2.0 + sampling.kept_s
        losses: FloatArray | float = sampling.unsure_s
        shifts = sampling.back_s + delays[part]
        if not declared:  # a mean that is known holds for the middle of a chunk
            stamps += sampling.chunk_s
        if not treatment.can_drop_samples:  # nothing else tells uneven samples from late stamps
            stamps += NEARLY_ALL * sampling.uneven_s
            losses += sampling.slip_s
        if way is Dejitter.AUTO and followed is not None and segment.basis is Basis.PROBES:
            time[part], doubt = followed
            stamps += doubt
            if sampling.unplaced or sampling.uncounted:
                losses += sampling.noise_s / 2.0
            # A mean that is declared is that of the session, and none of a while.
            open_s = sampling.noise_s if sampling.late_stamps else 0.0
            if declared and sampling.received is None:
                open_s = min(open_s, TWICE * float(np.max(delays[part])))
            stamps += max(sampling.shift_s, open_s)
        elif way in {Dejitter.LEAST_SQUARES, Dejitter.ENVELOPE}:
            index = sampling.index if raw.index is None else raw.index[part]
            time[part] = even(placed.time[part], index, way)
            stamps += sampling.noise_s / 4.0 + left_open(placed.time[part], time[part], way)
        else:
            stamps += sampling.noise_s + sampling.grid_s / 2.0
        for name, size in ((Term.STAMPS, stamps), (Term.LOSSES, losses), (Term.SHIFTS, shifts)):
            terms[name][part] += size
    return time, terms


def _rates(each: list[Sampling]) -> tuple[float, float]:
    """Return the rates at first and at last, if it changed within a clock or from one to the next.

    How often a clock changed is nothing that the sampler knows of.
    """
    known = [one for one in each if len(one.index) >= ENOUGH and not one.late_stamps]
    ends = [one.rates_hz or (one.rate_hz, one.rate_hz) for one in known]
    if not any(one.rates_hz for one in known or each) and not any(
        abs(after[0] / before[1] - 1.0) > RATE_CHANGE for before, after in itertools.pairwise(ends)
    ):
        return np.nan, np.nan
    ends = ends or [one.rates_hz for one in each if one.rates_hz]
    return float(ends[0][0]), float(ends[-1][1])


def _trips(raw: RawStream) -> dict[str, Any]:
    trips = raw.probes[:, RTT]
    p50, p95 = np.quantile(trips, (0.5, 0.95)) if len(trips) else (np.nan, np.nan)
    return {"rtt_p50_s": float(p50), "rtt_p95_s": float(p95)}


def _summed(
    raw: RawStream,
    placed: Placement,
    sampled: list[_Sampled],
    result: tuple[FloatArray, Terms, float | None],
    *,
    regular: bool,
) -> Quality:
    """Sum up how right the corrected times are, of a recording that ended when it is known."""
    time, terms, end = result
    segments, curves = placed.segments, placed.curves
    longest = max(segments, key=lambda part: part.stop - part.start)
    probed = longest.basis is Basis.PROBES
    steps, restarts, sleeps = clock_changes(segments, placed.time)
    known = [curve.probes[:, REMOTE] for curve in curves]
    finite = placed.time[np.isfinite(placed.time)]
    last = float(finite.max()) if len(finite) else np.nan
    if not regular:
        last = max(last, raw.answers_until())
    return Quality(
        hidden_s=max((curve.least_rtt / 2.0 for curve in curves), default=np.nan),
        drift_ppm=longest.drift_ppm if probed else np.nan,
        residual_s=longest.residual_s if probed else np.nan,
        probe_age_s=probe_age(raw.stamps, segments, np.concatenate([*known, np.empty(0)])),
        lag_s=placed.least_lag,
        steps=steps,
        restarts=restarts,
        sleeps=sleeps,
        slews=sum(curve.slews() for curve in curves),
        congested_s=sum(curve.congested_s() for curve in curves),
        silent_s=0.0 if end is None or np.isnan(last) else max(float(end - last), 0.0),
        unsure=sum(segment.unsure for segment in segments),
        unprobed=sum(s.stop - s.start for s in segments if s.basis is not Basis.PROBES),
        whose=placed.whose,
        frozen=_frozen(placed, sampled),
        ahead_s=placed.ahead_s,
        **_trips(raw),
        backward=_backward(time) if regular else sum(one.behind for _, one, _ in sampled),
        **_errors(time, terms, placed.time),
        **_flow(placed, sampled, regular=regular),
    )


def _frozen(placed: Placement, sampled: list[_Sampled]) -> int:
    """Return how many samples repeat a stamp, unless polls or programs got several at once."""
    scattered = any(one.late_stamps or one.uneven_s > 0.0 for _, one, _ in sampled)
    return placed.long_frozen if scattered else placed.frozen


def _backward(time: FloatArray) -> int:
    """Return how many samples are placed before one that came earlier, by more than rounding."""
    known = time[np.isfinite(time)]
    return int(np.count_nonzero(np.maximum.accumulate(known) - known > BACK_S))


def _errors(time: FloatArray, terms: Terms, uneven: FloatArray) -> dict[str, Any]:
    """Return how far the times may be off, and why, and how far evening moved them."""
    error = total(terms)
    known = np.isfinite(time) & np.isfinite(error)
    if not known.any():
        return {}
    p95, made_of = typical(terms, time)
    moved, furthest = np.quantile(np.abs(time - uneven)[known], (0.95, 1.0))
    worst, worst_at = worst_second(time, error)
    return {
        "error_p50_s": float(np.median(error[known])),
        "error_p95_s": p95,
        "made_of_s": made_of,
        "worst_s": worst,
        "worst_at_s": worst_at,
        "moved_p95_s": float(moved),
        "moved_max_s": float(furthest),
    }


def _flow(placed: Placement, sampled: list[_Sampled], *, regular: bool) -> dict[str, Any]:
    """Return what the segments' sampling says together."""
    each = [sampling for _, sampling, _ in sampled]
    shifts = [one.shifted.by_s for one in each if one.shifted is not None]
    told = {
        "dropped": sum(one.missing for one in each),
        "uncounted": int(any(one.uncounted for one in each)),
        "disordered": sum(one.disordered for one in each),
        "stalls": sum(one.stalls for one in each),
        "longest_stall_s": max((one.longest_stall_s for one in each), default=0.0),
        "shifts": sum(len(one) for one in shifts),
        "shift_s": max((float(np.abs(one).max()) for one in shifts if len(one)), default=0.0),
        "grid_s": max((one.grid_s for one in each), default=0.0),
    }
    if not regular or not sampled:
        known = placed.time[np.isfinite(placed.time)]
        span = float(np.ptp(known)) if len(known) else 0.0
        return told | {"rate_hz": (len(known) - 1) / span if span > 0.0 else np.nan}
    _, most, _ = max(sampled, key=lambda one: one[0].stop - one[0].start)
    first, last = _rates(each)
    pauses = [
        float(placed.time[after.start] - placed.time[before.stop - 1])
        for before, after in itertools.pairwise(placed.segments)
    ]
    pauses = [pause for pause in pauses if pause > PAUSE_S]
    return told | {
        "rate_hz": 1.0 / most.period,
        "first_rate_hz": first,
        "last_rate_hz": last,
        "gaps": sum(one.gaps for one in each) + len(pauses),
        "longest_gap_s": max([*(one.longest_gap_s for one in each), *pauses]),
        "noise_s": most.noise_s,
        "uneven_s": most.uneven_s,
        "late_stamps": int(most.late_stamps),
    }
