"""All measures of a participant, one row per movement."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.analysis.cohort import Participant
from labcrane.analysis.gaze import EYES as GAZE_EYES
from labcrane.analysis.gaze import gaze_measures, looks, with_unseen_areas
from labcrane.analysis.gaze_streams import EYES, MEAN
from labcrane.analysis.kinematics.halts import halts
from labcrane.analysis.kinematics.smoothness import ldlj, low_pass, path_ratio, sparc, sub_movements
from labcrane.analysis.movements import (
    Groups,
    Movement,
    cut,
    machine_of,
    movements_of,
)
from labcrane.analysis.presented import presented
from labcrane.analysis.quality import OF_AIMING, without_onset
from labcrane.analysis.sticks import (
    coordination,
    effort,
    inceptor_use,
    limit_hits,
    prediction_errors,
    resolution,
    reversals,
    steering_entropy,
    stick_use,
)
from labcrane.analysis.tables.body import BodySignals
from labcrane.analysis.tables.definitions import MEASURES, OF_ASSISTANCE
from labcrane.analysis.tables.measure_cache import kept
from labcrane.analysis.tables.responses import STIMULUS, in_trials, responses
from labcrane.analysis.unusable import Unusable
from labcrane.machines.machine import Machine
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

SHORTEST = 8
"""Movements of fewer ticks are not measured: their spectrum is meaningless."""


@dataclass(frozen=True, slots=True)
class MeasureSettings:
    """Settings of the measures; stored with every table of them.

    Attributes
    ----------
    dead_zone
        Deflection beyond which an axis is in use, as a fraction of full scale.
    stick_axes
        Last words of the names of axes that are sticks.
    hysteresis
        Change of an axis that makes a reversal, as a fraction of full scale.
    rate_window_s, moving_rate, stick_highest_hz
        Of :func:`~labcrane.analysis.sticks.inceptor_use`: window, least rate, highest frequency.
    sparc_highest_hz, sparc_least
        Of :func:`~labcrane.analysis.kinematics.smoothness.sparc`.
    low_pass_hz
        Cutoff at -3 dB of :func:`~labcrane.analysis.kinematics.smoothness.low_pass`, for jerk,
        sub-movements and path length.
    prominence
        Of :func:`~labcrane.analysis.kinematics.smoothness.sub_movements`.
    limit_tolerance_deg
        Distance in degrees at which a joint is at its limit.
    lag_most_s
        Largest lag of one hand behind the other, in seconds.
    look_least_s
        Minimum duration of a first look, in seconds.
    display_delay_s
        From handing a picture to the screen to its light, in seconds, as ``labcrane doctor
        --display`` measures it: which picture was looked at.
    gaze_stream
        Name of the gaze stream, where a session has several that could be measured.
    gaze_eye
        Eye that gaze is measured by: ``left``, ``right``, ``best`` (the one that is known in more
        samples of the session) or ``mean`` (both: gaze is known where one of them is).
    """

    dead_zone: float = 0.05
    stick_axes: tuple[str, ...] = ("x", "y")
    hysteresis: float = 0.02
    rate_window_s: float = 0.1
    moving_rate: float = 0.1
    stick_highest_hz: float = 10.0
    sparc_highest_hz: float = 10.0
    sparc_least: float = 0.05
    low_pass_hz: float = 6.0
    prominence: float = 0.05
    limit_tolerance_deg: float = 0.1
    lag_most_s: float = 0.5
    look_least_s: float = 0.066
    display_delay_s: float = 0.0
    gaze_stream: str = ""
    gaze_eye: str = MEAN

    def __post_init__(self) -> None:
        if self.gaze_eye not in EYES:
            raise ValueError(f"there is no gaze_eye {self.gaze_eye!r}; there is {', '.join(EYES)}")


DEFAULTS = MeasureSettings()


def measures_of(participant: Participant, settings: MeasureSettings = DEFAULTS) -> "pd.DataFrame":
    """Return one row per counted movement of all sessions: condition, results, measures.

    Computed once, and cached next to the participant file (:mod:`~.analysis.tables.measure_cache`).
    """
    if participant.measured is not None:
        return participant.measured
    about = {"measures": asdict(settings)}
    table = kept(participant.path, about, lambda: _all_sessions(participant, settings))
    table.insert(0, "participant", participant.name)
    table.insert(1, "status", str(participant.status))
    return table


def _all_sessions(participant: Participant, settings: MeasureSettings) -> "pd.DataFrame":
    import pandas as pd

    tables = []
    for number, session in participant.sessions():
        table = measure_session(session, settings)
        table.insert(0, "session", number)
        table.insert(1, "session_name", str(session.attrs.get("session_name", "")))
        tables.append(table)
    return with_unseen_areas(pd.concat(tables, ignore_index=True))


def measure_or_say_why(participant: Participant) -> tuple[str, Participant | Unusable]:
    """Return a participant with measures, or why there are none; a worker's function."""
    try:
        return participant.name, replace(participant, measured=measures_of(participant))
    except Exception as error:  # noqa: BLE001 - one recording never stops a cohort
        return participant.name, Unusable.of(error)


def measure_session(
    session: SessionRecord,
    settings: MeasureSettings = DEFAULTS,
    frames: Groups | None = None,
) -> "pd.DataFrame":
    """Return a session's trial table with the measures of each movement.

    ``frames``, those of a replay, replace the recorded frames.
    """
    import pandas as pd

    trials = session.trials
    if trials.empty:  # a session that ended before its first result has no columns either
        return trials
    machine = machine_of(session)
    rate_hz = float(session.attrs["rate_hz"])
    seen = looks(session, settings.display_delay_s, settings.gaze_stream, settings.gaze_eye)
    body = BodySignals(session)
    rows = []
    errors: list[FloatArray] = []
    for movement in cut(frames, trials, rate_hz) if frames else movements_of(session):
        row = measure(movement, machine, settings)
        errors.append(_errors(movement, settings))
        span = movement.span
        if seen is not None and span is not None:
            due = movement.due
            row |= gaze_measures(
                seen, due[0], due[span.start], due[span.stop - 1], settings.look_least_s,
                movement.pauses,
            )  # fmt: skip
        if span is not None:
            due = movement.due
            row |= body.measures(due[span.start], due[span.stop - 1], movement.pauses)
        rows.append(row)
    measured = pd.DataFrame(rows, index=trials.index)
    usual = float(np.quantile(np.abs(np.concatenate(errors)), 0.9)) if any(map(len, errors)) else 0
    measured["steering_entropy"] = [steering_entropy(each, usual) for each in errors]
    if seen is not None and seen.eyes:
        measured[GAZE_EYES] = seen.eyes
    if (session.events["name"] == STIMULUS).any():
        trials = in_trials(trials, responses(session, settings.display_delay_s))
    shown = presented(session)
    return pd.concat([ordered(trials), measured, shown], axis=1)


OF_TRIALS = ("sequence", "position", "constant_error", "absolute_error")
"""Measures that follow from the trial table alone."""


def measures_of_trials(trials: "pd.DataFrame") -> "pd.DataFrame":
    """Return a session's trial table with :data:`OF_TRIALS`, for which no frame is needed."""
    moved = ~without_onset(trials)
    errors = {
        name: trials[of].astype(float).where(moved) if of in trials else float("nan")
        for name, of in (("constant_error", "error_along"), ("absolute_error", "error"))
    }
    return ordered(trials).assign(**errors)


def ordered(trials: "pd.DataFrame") -> "pd.DataFrame":
    """Return the trials of a session with their place in it: ``sequence`` and ``position``."""
    return trials.assign(sequence=_sequence(trials), position=np.arange(1, len(trials) + 1))


def _sequence(trials: "pd.DataFrame") -> "pd.Series[Any]":
    """Return which pair of targets, or which trial where there are no pairs, counted from 1."""
    words = [name for name in ("block", "pair") if name in trials]
    if "pair" not in words:
        words = ["trial"]
    changed = (trials[words] != trials[words].shift()).any(axis=1)
    return changed.cumsum()


def measure(movement: Movement, machine: Machine, settings: MeasureSettings) -> dict[str, float]:
    """Return all measures of one movement; NaN where it has no onset, no offset, or no sticks."""
    span = movement.span
    nothing = {name: float("nan") for name in MEASURES if name not in {"sequence", "position"}}
    errors = {
        "constant_error": movement.result("error_along"),
        "absolute_error": movement.result("error"),
    }
    if set(OF_AIMING) <= movement.row.keys() and np.isnan(movement.result("movement_onset")):
        return nothing  # where the machine stood is not a measure of accuracy
    if span is None or span.stop - span.start < SHORTEST:
        return nothing | errors
    speed, tip = movement.speed[span], movement.tip[span]
    smooth = low_pass(movement.tip, movement.rate_hz, settings.low_pass_hz)
    return nothing | {
        **errors,
        **_strokes(movement, span),
        "amplitude": _along(movement, tip),
        "path_ratio": path_ratio(smooth[span]),
        "peak_speed_tip": float(speed.max()),
        "sub_movements": sub_movements(
            speed,
            movement.rate_hz,
            low_pass_hz=settings.low_pass_hz,
            prominence=settings.prominence,
        ),
        "sparc": sparc(
            speed,
            movement.rate_hz,
            highest_hz=settings.sparc_highest_hz,
            least=settings.sparc_least,
        ),
        "ldlj": ldlj(movement.velocity, movement.rate_hz, span, low_pass_hz=settings.low_pass_hz),
        **_sticks(movement, span, settings),
        **_machine_use(movement, span, machine, settings),
        **_assistance(movement, span),
    }


def _strokes(movement: Movement, span: slice) -> dict[str, float]:
    threshold, hold_s = movement.result("onset_speed"), movement.result("onset_hold")
    if np.isnan(threshold):  # of a task that does not say what a halt is
        return {}
    return halts(movement.elapsed[span], movement.speed[span], threshold=threshold, hold_s=hold_s)


def _along(movement: Movement, tip: FloatArray) -> float:
    axis = movement.point("target") - movement.point("start")
    return float((tip[-1] - tip[0]) @ axis / np.linalg.norm(axis))


def _axes(movement: Movement, span: slice, settings: MeasureSettings) -> dict[str, FloatArray]:
    return {
        name: values[span]
        for name, values in movement.axes.items()
        if name.rpartition(".")[2] in settings.stick_axes
    }


def _errors(movement: Movement, settings: MeasureSettings) -> FloatArray:
    """Return the errors of prediction of all its stick axes."""
    axes = _axes(movement, movement.span, settings) if movement.span else {}
    found = [prediction_errors(values, movement.rate_hz) for values in axes.values()]
    return np.concatenate(found) if found else np.empty(0)


def _sticks(movement: Movement, span: slice, settings: MeasureSettings) -> dict[str, float]:
    axes = _axes(movement, span, settings)
    if not axes:  # keys, or a panel whose axes are called otherwise
        return {}
    seconds = (span.stop - span.start) / movement.rate_hz
    step, least = resolution(axes)
    found = {
        "reversals": sum(reversals(each, settings.hysteresis) for each in axes.values()) / seconds,
        **stick_use(axes, settings.dead_zone),
        **inceptor_use(
            axes,
            movement.rate_hz,
            window_s=settings.rate_window_s,
            least_rate=settings.moving_rate,
            highest_hz=settings.stick_highest_hz,
        ),
        "stick_step": step,
        "stick_least": least,
    }
    hands = [_deflection(axes, stick) for stick in sorted({n.rpartition(".")[0] for n in axes})]
    if len(hands) == 2:  # noqa: PLR2004 - a pair of hands
        peak, lag = coordination(hands[0], hands[1], movement.rate_hz, settings.lag_most_s)
        found |= {"coordination": peak, "coordination_lag": lag}
    return found


def _deflection(axes: Mapping[str, FloatArray], stick: str) -> FloatArray:
    """Return how far a stick is from its centre, shape ``(n,)``."""
    own = [values for name, values in axes.items() if name.rpartition(".")[0] == stick]
    deflection: FloatArray = np.linalg.norm(own, axis=0)
    return deflection


def _assistance(movement: Movement, span: slice) -> dict[str, float]:
    """Return who moved the machine; NaN without an assistant."""
    if not movement.assist:
        return dict.fromkeys(OF_ASSISTANCE, float("nan"))
    share, operator, assistant = (
        movement.assist[name][span] for name in ("share", "operator", "assistant")
    )
    paths = [
        float(np.linalg.norm(part, axis=1).sum())
        for part in ((1.0 - share) * operator, share * assistant)
    ]
    whole = sum(paths)
    against = int(((operator * assistant).sum(axis=1) < 0.0).sum())
    parts = [path / whole if whole else float("nan") for path in paths]
    found = (float(share.mean()), *parts, against / movement.rate_hz)
    return dict(zip(OF_ASSISTANCE, found, strict=True))


def _machine_use(
    movement: Movement, span: slice, machine: Machine, settings: MeasureSettings
) -> dict[str, float]:
    tolerance = float(np.radians(settings.limit_tolerance_deg))
    return {
        "effort": effort(movement.command[span], np.array(machine.speeds)),
        "limit_hits": limit_hits(movement.angles[span], np.array(machine.limits), tolerance),
    }
