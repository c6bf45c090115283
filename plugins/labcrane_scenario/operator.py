"""A simulated operator at a control panel."""

import math

import numpy as np

from labcrane import (
    FloatArray,
    Frame,
    InputDevice,
    Machine,
    ProtocolError,
    Run,
    Signal,
    Tick,
    Trial,
)
from labcrane.core import Phase
from labcrane_scenario.lapses import Lapses
from labcrane_scenario.settings import PanelOperatorSettings

NEAR = 0.6
"""Proportion of a goal's radius within which the tip is not corrected while the jaws move."""

TOUCH_M_S = 0.03
"""Largest tip speed when a thing is to be touched: slow enough not to push it over."""

GENTLE = 3.0
"""Distance from a goal, in its radii, within which a thing is touched gently."""

CLOSE_RAD = 0.02
"""Tolerance of the jaws' opening, in rad."""


class ScenarioOperator(InputDevice):
    """Hands that take the tip to the task's target, and then open or shut the jaws as it asks.

    They see the frame before, like a person, and know the valves as ``run.inverse`` does. Where the
    settings say so they err.
    """

    def __init__(self, settings: PanelOperatorSettings, machine: Machine) -> None:
        button = (Signal(settings.button, "1"),) if settings.button else ()
        self.signals = (
            *(Signal(name, "1") for name in settings.axes_of(machine)),
            Signal("panel.connected", "1"),
            *button,
        )
        if settings.jaws not in machine.names:
            raise ProtocolError(
                f"jaws is {settings.jaws!r}; the machine has {', '.join(machine.names)}"
            )
        self._settings = settings
        self._joint = machine.names.index(settings.jaws)
        turned = settings.axes.get(settings.jaws, "").startswith("-")
        self._turned = -1.0 if turned else 1.0
        self._limits = machine.limits[self._joint]
        self._connected = len(machine.names)
        self._out = np.zeros(self._connected + 1 + len(button))
        self._trial = 0

    def open(self, run: Run) -> None:
        self._run = run
        self._tip = run.state.find("tip.position")
        self._angle = run.state.find("joint.angle").start + self._joint
        names = [signal.name for signal in run.task.signals]
        self._shown = {"target.position", "target.radius", "target.jaws"} <= set(names)
        if self._shown:
            self._target = run.task.find("target.position")
            self._radius = run.task.index("target.radius")
            self._jaws = run.task.index("target.jaws")
        self._touch = run.task.index("target.touch") if "target.touch" in names else None
        self._away = None
        if "deformity.distance" in names:
            self._away = run.task.index("deformity.distance")
        self._told = False
        columns = run.state.columns
        self._grip = columns.index("grip.thing") if "grip.thing" in columns else None
        self._wait = 0
        self._lapses: Lapses | None = None

    def begin_trial(self, trial: Trial) -> None:
        self._trial = trial.number
        self._told = False
        if self._settings.errs is not None:
            seeds = (self._run.participant_seed, trial.seed)
            self._lapses = Lapses(self._settings.errs, self._run.rate_hz, seeds)
        self._wait = round(self._settings.reaction_s * self._run.rate_hz)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        out = self._out
        out[:] = 0.0
        out[self._connected] = 1.0
        going = seen.trial == self._trial and seen.phase is Phase.RUNNING and not seen.paused
        if not (self._shown and going) or math.isnan(seen.task.item(self._radius)):
            return out
        pressed = bool(self._settings.button) and self._reports(seen)
        if pressed:
            out[self._connected + 1] = 1.0
        if self._wait > 0:
            self._wait -= 1
            return out
        away = seen.task[self._target] - seen.state[self._tip]
        distance = float(np.linalg.norm(away))
        lapses = self._lapses
        radius = seen.task.item(self._radius)
        touch = -1.0 if self._touch is None else seen.task.item(self._touch)
        if touch == 0.0 or (touch < 0.0 and distance > NEAR * radius):
            settings = self._settings
            gently = touch == 0.0 and distance < GENTLE * radius
            fastest = TOUCH_M_S if gently else settings.speed_m_s
            asked = away / distance * min(settings.gain_per_s * distance, fastest)
            if lapses is not None and (sinking := lapses.sinks()):
                asked = np.array([0.0, 0.0, -sinking])
            out[:] = self._run.inverse(asked, seen.state)
            out[self._connected] = 1.0
            if pressed:
                out[self._connected + 1] = 1.0
            out[self._joint] = 0.0
        if distance <= radius:
            self._move_jaws(seen, out)
        if lapses is not None and lapses.presses_on(held=self._holds(seen)):
            out[self._joint] = -self._turned * self._settings.signal
        return out

    def _reports(self, seen: Frame) -> bool:
        """Whether it presses the button for a deformity now: once in a trial, for a tick."""
        if self._told or self._away is None:
            return False
        away, lapses = seen.task.item(self._away), self._lapses
        if away >= 0.0:
            overlooked = lapses is not None and lapses.overlooks
            self._told = away <= self._settings.sees_m and not overlooked
        elif lapses is not None and lapses.imagines:
            self._told = any(event.name == "goal.reached" for event in seen.events)
        return self._told

    def _holds(self, seen: Frame) -> bool:
        return self._grip is not None and seen.state.item(self._grip) > 0.0

    def _move_jaws(self, seen: Frame, out: FloatArray) -> None:
        wanted = seen.task.item(self._jaws)
        if wanted < 0.0:
            return
        lowest, highest = self._limits
        away = lowest + wanted * (highest - lowest) - seen.state.item(self._angle)
        if abs(away) > CLOSE_RAD:
            out[self._joint] = self._turned * math.copysign(self._settings.signal, away)
