"""The aiming task."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from labcrane import Frame, Machine, ProtocolError, Run, Signal, Task, Trial
from labcrane.core import Event, Kernel, Phase, PlannedTrial, TrialStatus, compiled, kernel
from labcrane.machines import reach
from labcrane_aiming import law
from labcrane_aiming.pairs import Pair, Point, index_of_difficulty, pairs
from labcrane_aiming.settings import AimingSettings

if TYPE_CHECKING:  # a protocol is checked without loading numpy
    from labcrane import FloatArray
    from labcrane.core import Places, Sphere

# Seconds per movement in a plan: an intercept and seconds per bit, seen with simulated operators.
PLAN_INTERCEPT_S = 1.0
PLAN_SLOPE_S = 3.2

RUNNING = Phase.RUNNING  # Python 3.11 takes long to find it there in every tick; 3.12 does not


class Aiming(Task):
    """Two circles at a time; each movement goes from one to the other and is one trial.

    A pair of circles begins with an approach to its near circle, which is recorded but not counted.
    The machine continues from its present pose.
    """

    signals = (
        Signal("target.position", "m", ("x", "y", "z")),
        Signal("target.radius", "m"),
        Signal("other.position", "m", ("x", "y", "z")),
    )

    results = (
        Signal(
            "reaction_time",
            "s",
            definition=(
                "from the trial's start to the first stick beyond its dead zone, after all sticks "
                "were within it: a stick held since before the trial is not a response"
            ),
        ),
        Signal("command_onset", "s", definition="from the trial's start to the first command"),
        Signal("movement_onset", "s", definition="from the trial's start to the machine's onset"),
        Signal(
            "onset_speed",
            "m/s",
            definition=(
                "tip speed that defined the onset; in recordings without it, an earlier rule "
                "defined the onset"
            ),
        ),
        Signal(
            "onset_hold",
            "s",
            definition="time for which the tip had to exceed onset_speed for an onset",
        ),
        Signal(
            "movement_time",
            "s",
            definition=(
                "from the machine's onset to the offset: the tap, or the beginning of the rest "
                "that ended the movement; without reaction time. Movement time in Dreger et al. is "
                "circle_to_circle"
            ),
        ),
        Signal(
            "onset_to_rest",
            "s",
            definition=(
                "from the machine's onset to the beginning of the rest in which the movement ended"
            ),
        ),
        Signal(
            "at_rest", "s", definition="duration of that rest at the trial's end; 0 while moving"
        ),
        Signal(
            "circle_to_circle",
            "s",
            definition=(
                "from the end of the previous movement, which is the trial's start, to the offset, "
                "with reaction time and dwell: the movement time of Dreger et al.; NaN without an "
                "onset"
            ),
        ),
        Signal("between_circles", "s", definition="from leaving one circle to entering the other"),
        Signal(
            "first_entry", "s", definition="from the trial's start to the first entry of the circle"
        ),
        Signal("entries", "1", definition="number of times that the tip entered the circle"),
        Signal(
            "error", "m", definition="distance of the tip from the circle's centre at the offset"
        ),
        Signal("error_along", "m", definition="error along the task axis, positive for overshoot"),
        Signal("error_across", "m", definition="error across the task axis"),
        Signal(
            "error_bound",
            "m",
            definition="largest error that the end rule allows; NaN without a limit",
        ),
        Signal("path_length", "m", definition="length of the tip's path from onset to offset"),
        Signal("peak_speed", "m/s", definition="largest speed of the tip in the trial"),
    )

    conditions = (
        Signal("pair", "", definition="the pair of circles, by distance and place of the far one"),
        Signal("distance", "m", definition="from the centre of one circle to that of the other"),
        Signal("width", "m", definition="diameter of the circles"),
        Signal(
            "difficulty",
            "bit",
            definition="index of difficulty, log2(distance / width + 1) (ISO 9241-411)",
        ),
        Signal("far_side", "", definition="side of the far circle, seen from the machine"),
        Signal(
            "movement",
            "1",
            definition="number of the movement of the pair, from 1; 0 goes to its first circle",
        ),
        Signal(
            "direction", "", definition="outward: to the far circle; inward: back to the near one"
        ),
        *(
            Signal(f"{which}_{axis}", "m", definition=f"centre of the {circle}, {axis}")
            for which, circle in (("start", "circle that is left"), ("target", "target circle"))
            for axis in "xyz"
        ),
    )

    def __init__(self, settings: AimingSettings, machine: Machine) -> None:
        self._settings = settings
        self._pairs = {pair.name: pair for pair in pairs(settings)}
        for pair in self._pairs.values():
            for which, point in (("near", pair.near), ("far", pair.far)):
                if reach(machine, point) is None:
                    raise ProtocolError(
                        f"the {which} circle of pair {pair.name!r} at "
                        f"({', '.join(_short(value) for value in point)}) m is out of reach of "
                        f"the {machine.title}; move the centre or shorten the distance",
                        at=self._to_blame(pair.distance, machine),
                    )

    def _to_blame(self, distance: float, machine: Machine) -> tuple[str | int, ...]:
        if reach(machine, self._settings.centre) is None:
            return ("centre",)
        return ("distances", self._settings.distances.index(distance))

    def factors(self) -> Mapping[str, Sequence[str]]:
        return {"pairs": tuple(self._pairs)}

    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        return [
            self._planned(self._pairs[name], number)
            for name in levels["pairs"]
            for number in range(self._settings.movements + 1)
        ]

    def _planned(self, pair: Pair, number: int) -> PlannedTrial:
        outward = number % 2 == 1  # the approach, number 0, ends at the near circle
        start, target = (pair.near, pair.far) if outward else (pair.far, pair.near)
        difficulty = index_of_difficulty(pair.distance, self._settings.width)
        condition = {
            "pair": pair.name,
            "distance": pair.distance,
            "width": self._settings.width,
            "difficulty": difficulty,
            "far_side": pair.side,
            "movement": number,
            "direction": "outward" if outward else "inward",
            **dict(zip(("start_x", "start_y", "start_z"), start, strict=True)),
            **dict(zip(("target_x", "target_y", "target_z"), target, strict=True)),
        }
        expected = PLAN_INTERCEPT_S + PLAN_SLOPE_S * difficulty
        return PlannedTrial(condition, expected_s=expected, counted=number > 0)

    def places(self) -> "Sequence[Sphere]":
        from labcrane.core import Sphere  # noqa: PLC0415 - nor what is drawn

        radius = self._settings.width / 2
        return [
            Sphere(f"{pair.name} {which}", point, radius, (0.9, 0.1, 0.1, 1.0))
            for pair in self._pairs.values()
            for which, point in (("near", pair.near), ("far", pair.far))
        ]

    def open(self, run: Run) -> None:
        # A protocol is checked, and a study planned, without loading numpy.
        from labcrane_aiming.movement import AimedMovement  # noqa: PLC0415

        self._movement_from = partial(AimedMovement, self._settings)
        self._tip = run.state.find("tip.position")
        self._velocity = run.state.find("tip.velocity")
        self._command = run.command.find("command")
        self._trigger = (
            run.axes.index(self._settings.trigger) if self._settings.end == "trigger" else None
        )

    def begin_trial(self, trial: Trial) -> None:
        condition = trial.planned.condition
        start, target = _point(condition, "start"), _point(condition, "target")
        self._movement = self._movement_from(start, target)
        self._values = self._movement.shown
        self._going_on = TrialStatus(Phase.RUNNING, self._values)  # what most ticks are
        self._limit = self._settings.limit_s
        self._begun = False
        self._pressed = True  # a trigger still held from the last movement ends nothing

    def lift_limits(self) -> None:
        self._limit = math.inf

    def evaluate(self, frame: Frame) -> TrialStatus:
        movement, state = self._movement, frame.state.tolist()
        movement.see(frame.elapsed, frame.tick.due, state[self._tip], state[self._velocity])
        events = self._moments(frame)
        phase, end = self._phase(frame, events)
        if not phase.over:
            return TrialStatus(phase, self._values, tuple(events)) if events else self._going_on
        if end is not None:
            events.append(Event("movement.offset", movement.due[end]))
        return TrialStatus(phase, self._values, tuple(events), movement.measures(end))

    def kernel(self) -> Kernel:
        import numpy as np  # noqa: PLC0415 - as in open

        own = np.zeros(law.SHOWN + 7)
        tick = compiled.tick(law.evaluate)
        return Kernel(tick, own, law.CHANGING, self._take_over, self._hand_back)

    def _take_over(self, own: "FloatArray", seen: Frame) -> bool:
        from labcrane_aiming.movement import ROUNDING_S  # noqa: PLC0415 - loads numpy

        settings, movement, command = self._settings, self._movement, self._command
        if not movement.ticks:
            return False
        own[: law.SHOWN] = (
            movement.rest_since, movement.inside, movement.entries, self._pressed,
            movement.fast_since, movement.hands_off, movement.begun,
            not math.isnan(movement.command_onset), not math.isnan(movement.reaction_time),
            settings.rest_speed, settings.rest_s - ROUNDING_S, self._limit, settings.width / 2,
            law.END_RULES.index(settings.end), self._trigger or 0, settings.rest_after,
            self._tip.start, self._velocity.start, command.start, command.stop,
            settings.onset_speed, settings.onset_hold_s - ROUNDING_S, movement.elapsed[0],
            movement.distance[0],
        )  # fmt: skip
        own[law.SHOWN :] = self._values
        return True

    def _hand_back(self, own: "FloatArray", rows: "FloatArray", places: "Places") -> None:
        movement, at = self._movement, int(places[kernel.STATE])
        tip, velocity = self._tip, self._velocity
        movement.go_on(
            rows[:, kernel.ELAPSED], rows[:, kernel.TIME], rows[:, at + tip.start : at + tip.stop],
            rows[:, at + velocity.start : at + velocity.stop],
        )  # fmt: skip
        movement.rest_since, inside, entries, pressed, movement.fast_since, off = own[:6].tolist()
        movement.hands_off = bool(off)
        movement.inside, movement.entries = bool(inside), int(entries)
        self._pressed = bool(pressed)

    def _moments(self, frame: Frame) -> list[Event]:
        movement, due = self._movement, frame.tick.due
        events = []
        if movement.ticks == 1:
            events.append(Event("targets.shown", due))
        if math.isnan(movement.reaction_time):
            silent = math.isnan(movement.command_onset)
            movement.command(frame.elapsed, given=bool(frame.command[self._command].any()))
            if silent and not math.isnan(movement.command_onset):
                events.append(Event("command.onset", due))
        if movement.begun and not self._begun:
            self._begun = True
            began = movement.due[movement.tick_at(movement.onset)]
            events.append(Event("movement.onset", began, {"delay_s": due - began}))
        if movement.entered:
            movement.entries += 1
            if movement.entries == 1:
                movement.first_entry = frame.elapsed
                events.append(Event("target.entered", due))
        return events

    def _phase(self, frame: Frame, events: list[Event]) -> tuple[Phase, int | None]:
        movement = self._movement
        if self._trigger is not None:
            pressed = bool(frame.axes[self._trigger] > law.PRESS)
            edge, self._pressed = pressed and not self._pressed, pressed
            if edge and self._is_tap(frame.elapsed):
                return Phase.SUCCESS, movement.ticks - 1
            if edge:
                events.append(Event("tap.ignored", frame.tick.due, {"before": "movement.onset"}))
        elif movement.rested and self._arrived():
            return Phase.SUCCESS, movement.tick_at(movement.rest_since)
        if frame.elapsed >= self._limit:
            return Phase.TIMEOUT, None
        return RUNNING, None

    def _is_tap(self, elapsed: float) -> bool:
        """Whether a press now is the tap that ends the movement.

        A second press or a bouncing button is not a tap. If the tip is in the target without having
        moved, as after a repeated trial, a press counts only after a while: it may belong to the
        last movement.
        """
        settings, movement = self._settings, self._movement
        return movement.begun or (movement.inside and elapsed >= settings.rest_s)

    def _arrived(self) -> bool:
        if self._settings.end != "rest_anywhere":
            return True
        movement = self._movement
        # In a repeated trial, the tip may start beyond that share of the way.
        return movement.done >= self._settings.rest_after and (movement.inside or movement.begun)


def _short(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 1e6 else f"{value:g}"  # noqa: PLR2004 - a screen's width


def _point(condition: Mapping[str, object], name: str) -> Point:
    x, y, z = (float(str(condition[f"{name}_{axis}"])) for axis in "xyz")
    return x, y, z
