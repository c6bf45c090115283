"""Every segment of the simulated arm, driven through the engine's steps as the real one was.

One segment at a time, which is how it was recorded.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labcrane import FloatArray, Machine, ProtocolError, RecordingError, Run, Signal
from labcrane.core import Layout
from labcrane_dmd.arm.arm import DmdArm
from labcrane_dmd.arm.settings import ArmSettings, JawsSettings
from labcrane_dmd.fit.fitting import LAGS, curve_at
from labcrane_dmd.fit.recordings import JointRun, SegmentRecording
from labcrane_dmd.fit.validation import Level, of_segments, validation_signals
from labcrane_dmd.model.model import Model, SegmentModel

LONGER = 1.1
"""A slower arm is waited for this much longer than the recorded one needed."""

STILL_RAD = 1e-9
"""Movement per step below which a joint counts as at rest: what remains at an end stop is
rounding."""

STANDS_S = 1.5
"""How long an arm that has arrived is watched, as the recordings do."""


@dataclass(frozen=True, slots=True)
class DrivenLevel:
    """One segment, driven at one signal.

    Attributes
    ----------
    level
        Recorded speeds, and as ``predicted`` those measured on the driven arm; deg/s.
    run
        The driven joint's angles, one per tick.
    formula_error
        Largest difference of the joint's speed in any tick and the model's for the valve's opening
        and the angle in that tick, in deg/s: what the engine adds to the formula.
    """

    level: Level
    run: JointRun
    formula_error: float

    def row(self) -> dict[str, str | float]:
        """Return the level's line of the table."""
        return {**self.level.row(), "formula_error": self.formula_error}


def drive(
    settings: ArmSettings,
    model: Model,
    machine: Machine,
    recordings: Sequence[SegmentRecording],
    rate_hz: float,
    tell: Callable[[str], None] = lambda text: None,
) -> tuple[DrivenLevel, ...]:
    """Drive every segment at the validation signals, in both directions and at 0, and measure it.

    Each run begins where the recorded one did, and is made into speeds in the same way.

    Parameters
    ----------
    settings, machine
        The arm; its model must be ``model``.
    model
        With the rule between layers that is validated.
    recordings
        Of the real arm.
    rate_hz
        Steps per second.
    tell
        Called with each segment before it is driven.

    Raises
    ------
    ProtocolError
        The machine lacks a segment of the model, or has no law for one of its joints.
    RecordingError
        A recording of a segment, or one of the signals, is missing.
    """
    if missing := [name for name in model if name not in machine.names]:
        raise ProtocolError(
            f"the machine has no joint {', '.join(map(repr, missing))}, which the model describes; "
            f"it has {', '.join(machine.names)}"
        )
    named = of_segments(model, recordings)
    bench = _Bench(DmdArm(settings, machine, model), machine, rate_hz)
    try:
        found = []
        for name in model:
            signals = validation_signals(model, named[name])
            tell(f"drives {name} at {', '.join(f'{signal:+d}' for signal in signals)}")
            found += [_level(bench, model[name], named[name], signal) for signal in signals]
        return tuple(found)
    finally:
        bench.close()


def arm_settings(machine: Machine, model: Model, file: Path) -> ArmSettings:
    """Return settings of an arm that moves by the model in a file.

    Joints that the model lacks are proportional; a last joint without length is the jaws'.
    """
    last = machine.joints[-1]
    return ArmSettings(
        model=file,
        proportional=tuple(name for name in machine.names if name not in model),
        jaws=JawsSettings(joint=last.name) if not last.a and last.name in model else None,
    )


class _Bench:
    """An arm that is driven one joint at a time."""

    def __init__(self, arm: DmdArm, machine: Machine, rate_hz: float) -> None:
        self._arm, self._machine, self._rate_hz = arm, machine, rate_hz
        layout = Layout("the machine", tuple(arm.signals))
        command = Layout("the bench", (Signal("valve.signal", "1", machine.names),))
        none = Layout("nobody")
        arm.open(
            Run(rate_hz, machine, 1, none, command, layout, none, lambda velocity, state: velocity)
        )
        self._places = {
            name: [layout.index(f"{what}.{name}") for what in ("joint.angle", "valve.opening")]
            + [layout.index(f"joint.end.{name}")]
            for name in machine.names
        }

    def close(self) -> None:
        self._arm.close()

    def run(self, segment: SegmentModel, recorded: JointRun) -> tuple[JointRun, float]:
        """Drive one joint as it was recorded; return its angles, and the engine's worst error."""
        joint = self._machine.names.index(segment.name)
        pose = list(self._machine.rest)
        start = float(np.mean(recorded.angle[: max(recorded.step, 1)]))
        pose[joint] = min(
            max(start, self._machine.limits[joint][0]), self._machine.limits[joint][1]
        )
        self._arm.reset(pose)
        angle_at, opening_at, end_at = self._places[segment.name]
        dt = 1.0 / self._rate_hz
        step = round(float(recorded.time[recorded.step]) * self._rate_hz)
        most = step + round(LONGER * float(recorded.time[-1]) * self._rate_hz)
        command = np.zeros(len(pose))
        angles, worst, stood = [pose[joint]], 0.0, 0
        for tick in range(most):
            command[joint] = recorded.signal if tick >= step else 0.0
            state = self._arm.step(command, dt)
            before, after, at_end = angles[-1], state.item(angle_at), state.item(end_at) != 0.0
            if not at_end:
                said = segment.speed(state.item(opening_at), before)
                worst = max(worst, abs((after - before) / dt - said))
            stood = stood + 1 if at_end and tick > step and abs(after - before) < STILL_RAD else 0
            angles.append(after)
            if stood * dt > STANDS_S and recorded.signal:
                break
        time: FloatArray = dt * np.arange(len(angles), dtype=np.float64)
        run = JointRun(recorded.number, recorded.signal, step + 1, time, np.array(angles))
        return run, float(np.degrees(worst))


def _level(
    bench: _Bench, segment: SegmentModel, recording: SegmentRecording, signal: int
) -> DrivenLevel:
    run, worst = bench.run(segment, recording.at(signal)[0])
    direction = segment.direction(signal)
    run_up = direction.dead_time + LAGS * direction.lag
    real = curve_at(recording, signal, run_up)
    driven = curve_at(SegmentRecording(segment.name, "", "", (run,)), signal, run_up)
    if real is None or driven is None:  # one of them did not move, and counts as that
        other = real or driven
        angle = np.linspace(*segment.limits, 20) if other is None else other.angle
        recorded = np.zeros_like(angle) if real is None else real.speed
        measured = np.zeros_like(angle) if driven is None else driven.speed
    else:
        lowest = max(real.covers[0], driven.covers[0])
        highest = min(real.covers[1], driven.covers[1])
        shared = (real.angle >= lowest) & (real.angle <= highest)
        if not shared.any():
            raise RecordingError(
                f"{segment.name} at {signal:+d}: the driven arm and the recording have no angle in "
                "common after their run-up; record the run from further away"
            )
        angle, recorded = real.angle[shared], real.speed[shared]
        measured = np.interp(angle, driven.angle, driven.speed)
    level = Level(
        segment.name, signal, np.degrees(angle), np.degrees(recorded), np.degrees(measured)
    )
    return DrivenLevel(level, run, worst)
