"""Loop-back check: a stream's times beside the session's own pictures and sounds.

A photodiode on a view's patch, or a microphone at the loudspeaker, goes into a channel of a
recorded stream. Each change that the view or sound logged is in that channel, too, and always
equally late. It is the only check of a stream's times that includes the device itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labcrane.core.findings import Finding, Verdict
from labcrane.errors import DeviceError
from labcrane.streams.edges import EARLY_S, Change, Delay, in_short, onsets, steps
from labcrane.types import FloatArray

BEFORE_S, AFTER_S = 0.15, 0.45
"""What is looked at about a change: longer than screens and sound devices are late."""

SCATTERS_S = 0.03
"""Screens and sound devices are late by amounts that differ by less, a standard deviation."""

PARTS = 3
"""The first third of the session is compared with the last."""

FEWEST = 4
"""Changes in a third for its mean to have a standard error."""

TWO_SIDED = 1.96
"""Standard errors at 95 %, as uncertainties of times are stated."""


@dataclass(frozen=True, slots=True)
class LoopBack:
    """How late a sensor's channel is. Times are seconds; NaN where it is not known.

    Attributes
    ----------
    stream, channel, of
        The channel, and the view or sound that it sees or hears.
    stated_s
        Uncertainty of the stream's times at 95 %.
    delay
        From each change, as logged, to the sensor; None where too few were seen.
    moved_s, noise_s
        By how much the delay of the last third is longer than that of the first, and the
        uncertainty of this difference at 95 % from its scatter.
    declared_s
        Lag of a camera or microphone that is declared, and subtracted from the times already.
    """

    stream: str
    channel: str
    of: str
    stated_s: float
    verdict: Verdict
    delay: Delay | None = None
    moved_s: float = float("nan")
    noise_s: float = float("nan")
    findings: tuple[Finding, ...] = ()
    declared_s: float = float("nan")

    def in_words(self) -> str:
        """Return what was measured, in a sentence without its end."""
        if self.delay is None:
            return f"{self.channel} does not show {self.of}"
        late = self.delay
        moved = (
            f"; from the first third to the last it moves by {1e3 * self.moved_s:+.2f} ms"
            if np.isfinite(self.moved_s)
            else ""
        )
        return (
            f"{self.channel} shows {late.seen} of {late.asked} changes of {self.of}, "
            f"{1e3 * late.mean_s:.2f} ms later on average (SD {1e3 * late.sd_s:.2f} ms){moved}"
            f"{self._lag}"
        )

    @property
    def _lag(self) -> str:
        if self.delay is None or not np.isfinite(self.declared_s):
            return ""
        measured = self.declared_s + self.delay.mean_s
        return (
            f"; a lag of {1e3 * self.declared_s:.2f} ms is declared, and with it "
            f"{1e3 * measured:.2f} ms are measured"
        )


def judge_loop_back(
    names: tuple[str, str, str],
    changes: Sequence[Change],
    signal: tuple[FloatArray, FloatArray],
    stated_s: float,
    *,
    light: bool,
    upright: bool = False,
) -> LoopBack:
    """Compare a channel with the changes that it was to see or hear.

    A steady delay is that of screen and sensor, and passes. It fails if the delay moves by more
    than the stated uncertainty of two times, or if the sensor is earlier than the change.

    Parameters
    ----------
    names
        Stream, channel, and the view or sound.
    changes
        As the view or sound logged them; those outside the recorded signal are left out.
    signal
        Times on our clock, and values, both of shape ``(n,)``.
    stated_s
        Uncertainty of the times at 95 %.
    light
        Whether it is a photodiode; otherwise it hears or feels.
    upright
        Whether light makes the signal rise, as in a film; amplifiers have either sign.
    """
    times, values = signal
    changes = [one for one in changes if len(times) and times[0] <= one.time <= times[-1]]
    if not changes:
        finding = Finding(
            Verdict.WARN,
            f"{names[2]} did not change while {names[1]} was recorded",
            "let it change on events of the session, and start the device before it",
        )
        return LoopBack(*names, stated_s, Verdict.WARN, findings=(finding,))
    sensor_hz = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else float("nan")
    # An edge may be as early as times may be off, and by a sample.
    early_s = EARLY_S + float(np.nan_to_num(stated_s)) + float(np.nan_to_num(1.0 / sensor_hz))
    late = np.array(
        [
            _late(one, after, times, values, early_s, light=light, upright=upright)
            for one, after in _spans(changes)
        ]
    )
    try:
        found = in_short(late, sensor_hz)
    except DeviceError as error:
        failed = Finding.failed(
            DeviceError(f"{error}; longer delays than {AFTER_S:g} s are not seen")
        )
        return LoopBack(*names, stated_s, Verdict.FAIL, findings=(failed,))
    at = np.flatnonzero(np.isfinite(late))
    first, last = late[at[: len(at) // PARTS]], late[at[len(at) - len(at) // PARTS :]]
    moved = noise = float("nan")
    findings = []
    if len(first) >= FEWEST:
        moved = float(last.mean() - first.mean())
        spread = np.var(first, ddof=1) / len(first) + np.var(last, ddof=1) / len(last)
        noise = TWO_SIDED * float(np.sqrt(spread))
        if abs(moved) > 2.0 * stated_s + noise:
            findings.append(
                Finding(
                    Verdict.FAIL,
                    f"the delay from {names[2]} to {names[1]} grows by {1e3 * moved:+.2f} ms from "
                    "the first third of the session to the last, and times are stated within "
                    f"{1e3 * stated_s:.2f} ms",
                    "do not use this stream's times at that accuracy; ask the maker how its "
                    "samples are stamped",
                )
            )
    if found.sd_s > SCATTERS_S + 2.0 * stated_s + 1.0 / sensor_hz:
        findings.append(
            Finding(
                Verdict.FAIL,
                f"the delays from {names[2]} to {names[1]} scatter by {1e3 * found.sd_s:.0f} ms: "
                "some may be of the change before",
                f"let {names[2]} change once a second at most, and measure again",
            )
        )
    early = float(np.quantile(late[at], 0.05))
    if early < -(stated_s + 1.0 / sensor_hz):
        findings.append(
            Finding(
                Verdict.FAIL,
                f"{names[1]} shows {names[2]} {-1e3 * early:.2f} ms before it changed",
                "correct latency_s of the stream, and check which view or sound the sensor is at",
            )
        )
    verdict = Verdict.FAIL if findings else Verdict.PASS
    return LoopBack(*names, stated_s, verdict, found, moved, noise, tuple(findings))


def _spans(changes: Sequence[Change]) -> list[tuple[Change, float]]:
    """Return each change, and when the next one is."""
    return list(zip(changes, [*(one.time for one in changes[1:]), np.inf], strict=True))


def _late(
    change: Change,
    after: float,
    times: FloatArray,
    values: FloatArray,
    early_s: float,
    *,
    light: bool,
    upright: bool,
) -> float:
    """Return how long after a change the first edge is near it; NaN without one."""
    first, end = np.searchsorted(
        times, (change.time - BEFORE_S, min(change.time + AFTER_S, after - EARLY_S))
    )
    near, level = times[first:end], values[first:end]
    if len(near) < 2 or not np.isfinite(level).all():  # noqa: PLR2004
        return float("nan")
    try:
        edges = steps(near, level) if light else onsets(near, level)
    except DeviceError:
        return float("nan")
    late = (
        edge.time - change.time
        for edge in edges
        if edge.time >= change.time - early_s and (edge.up == change.up or not (upright and light))
    )
    return next(late, float("nan"))
