"""A simulated operator that closes the loop through the scheme and the machine of the study."""

import math
from collections.abc import Mapping

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Run, Signal, Tick, Trial
from labcrane.core import Kernel, Layout, Phase, Places, Value, compiled
from labcrane_operator import law
from labcrane_operator.aimer import STILL, Aimer
from labcrane_operator.noise import Noise
from labcrane_operator.responder import Responder
from labcrane_operator.settings import CONNECTED, STICK, OperatorSettings

RESPONSE_COST = 0.1
"""How much longer the movements of a trial with a secondary task take, as a fraction; invented."""

RUNNING = Phase.RUNNING  # Python 3.11 takes long to find it there in every tick; 3.12 does not


def _signals(settings: OperatorSettings) -> tuple[Signal, ...]:
    """Return the operator's signals: two joysticks, or the axes in the settings."""
    if not settings.axes:
        return (Signal("left", "1", STICK), Signal("right", "1", STICK))
    button = (settings.button,) if settings.button else ()
    return tuple(Signal(name, "1") for name in (*settings.axes, *button, CONNECTED))


class SimulatedOperator(InputDevice):
    """Hands on a dual joystick, or on other axes, that take the tip to the task's target.

    They see the frame before, like a person, and steer through ``run.inverse`` as the scheme needs.
    Time is counted in ticks of the trial that were not paused, so a pause only shifts the plan.
    At rest inside the target they press the trigger of the right stick, or the button, once, for
    tasks that end a movement by it.
    """

    def __init__(self, settings: OperatorSettings) -> None:
        self._settings = settings
        self.signals = _signals(settings)
        axes = Layout("the operator", self.signals)
        if settings.axes:
            self._left = self._right = axes.index(CONNECTED)
            # Without a button it presses what is pressed anyway.
            self._trigger = axes.index(settings.button or CONNECTED)
        else:
            self._left, self._right = axes.index("left.connected"), axes.index("right.connected")
            self._trigger = axes.index("right.trigger")
        self._out = np.zeros(axes.size)
        self._asked = np.zeros(3)
        self._rest = np.zeros(axes.size)
        self._rest[[self._left, self._right]] = 1.0
        self._pace = 1.0
        self._trial = 0
        self._aimer: Aimer | None = None
        self._responder: Responder | None = None

    def open(self, run: Run) -> None:
        self._run = run
        self._tip = run.state.find("tip.position")
        self._velocity = run.state.find("tip.velocity")
        self._shown = bool(run.task.signals)  # a task that shows nothing shows no target
        if self._shown:
            self._target = run.task.find("target.position")
            self._radius = run.task.index("target.radius")
        response, axes = self._settings.response, Layout("the operator", self.signals)
        if response is not None:
            self._button = axes.index(response.button)
            hands = [at for at, name in enumerate(axes.columns) if self._steers(name)]
            stimulus = run.task.index(response.to)
            self._responder = Responder(response, stimulus, hands, run.rate_hz)
        person = np.random.default_rng(run.participant_seed)
        self._pace = math.exp(self._settings.pace_sd * float(person.standard_normal()))

    def begin_trial(self, trial: Trial) -> None:
        settings, dt = self._settings, 1.0 / self._run.rate_hz
        gain = settings.learning_gain * math.exp(-settings.learning_rate * (trial.number - 1))
        pace, response = self._pace * (1.0 + gain), settings.response
        if response is not None and self._responder is not None:
            self._responder.begin_trial(trial.seed)
            if response.to.partition(".")[0] in trial.active:
                pace *= 1.0 + RESPONSE_COST
        self._aimer = Aimer(settings, Noise(trial.seed), pace, dt)
        self._trial = trial.number

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        out = self._steer(seen)
        if self._responder is not None:
            out[self._button] = float(self._responder.pressing(seen))
        return out

    def _steers(self, name: str) -> bool:
        part = name.rpartition(".")[2]
        return name in self._settings.axes if self._settings.axes else part in {"x", "y"}

    def _steer(self, seen: Frame) -> FloatArray:
        aimer, out = self._aimer, self._out
        out[:] = self._rest
        if aimer is None or not self._sees(seen):  # values of the last trial are not a target
            return out
        task, state = seen.task.tolist(), seen.state.tolist()  # once: plain floats are cheaper
        x, y, z = task[self._target]
        if math.isnan(x):
            aimer.rest()
            return out
        vx, vy, vz = state[self._velocity]
        speed = math.sqrt(vx * vx + vy * vy + vz * vz)
        velocity = aimer.move(tuple(state[self._tip]), speed, (x, y, z), task[self._radius])
        if velocity is not STILL:
            asked = self._asked
            asked[0], asked[1], asked[2] = velocity  # sooner done than by a slice
            out[:] = self._run.inverse(asked, seen.state)
            out[self._left] = out[self._right] = 1.0
        if aimer.pressing:
            out[self._trigger] = 1.0
        return out

    def metadata(self) -> Mapping[str, Value]:
        return {"simulated": True, "pace": self._pace}

    def kernel(self) -> Kernel | None:
        if not self._shown or self._responder is not None:
            return None
        own = np.zeros(law.DRAWN + 3 * law.BLOCK)
        own[law.LEFT_ON : law.ASKED] = (
            self._left, self._right, self._trigger, self._tip.start, self._velocity.start,
            self._target.start, self._radius,
        )  # fmt: skip
        hands = compiled.read(law.hands)
        return Kernel(hands, own, law.CHANGING, self._take_over, self._hand_back)

    def _take_over(self, own: FloatArray, seen: Frame) -> bool:
        aimer = self._aimer
        if aimer is None or not self._sees(seen):
            return False
        if not aimer.is_at(tuple(seen.task[self._target].tolist())):
            return False  # it turns to a target, or rests without one
        drawn = law.DRAWN + 3 * int(aimer.own[law.LEFT])
        own[: law.LEFT_ON] = aimer.own[: law.LEFT_ON]
        own[law.DRAWN : drawn] = aimer.own[law.DRAWN : drawn]
        return True

    def _hand_back(self, own: FloatArray, rows: FloatArray, places: Places) -> None:
        if self._aimer is not None:
            self._aimer.own[: law.CHANGING] = own[: law.CHANGING].tolist()

    def _sees(self, seen: Frame) -> bool:
        """Say whether the frame shows this trial, going on."""
        return (
            self._shown and seen.trial == self._trial and seen.phase is RUNNING and not seen.paused
        )
