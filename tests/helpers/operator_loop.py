"""The simulated operator in the closed loop, in small: operator, scheme and crane."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from ideal_crane import IdealCrane

from labcrane import Controller, FloatArray, Frame, Machine, Run, Signal, Tick, Trial
from labcrane.core import CraneSettings, Phase, PlannedTrial
from labcrane.machines import ACTUATOR_PRESETS
from labcrane.testing import RATE_HZ, ch8, make_run
from labcrane_bullet.kinematic_crane import KinematicCrane
from labcrane_operator.operator import SimulatedOperator
from labcrane_operator.settings import OperatorSettings
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.settings import EndEffectorSettings, JointVelocitySettings

TASK = (Signal("target.position", "m", ("x", "y", "z")), Signal("target.radius", "m"))
NOTHING_SHOWN = (math.nan, math.nan, math.nan, math.nan)
JOINTS = {"slew": "left.x", "elbow": "left.y", "wrist": "right.x", "shoulder": "-right.y"}
BASE = {"x": "left.y", "y": "-left.x", "z": "right.y"}
CENTRE, RADIUS = np.array([5.5, 0.0, 0.8]), 0.25
DISTANCES = (2.0, 3.0, 4.0, 6.0)


def ends(distance: float, mirror: int = 1) -> list[FloatArray]:
    """Return the two targets of a diagonal pair, near and far, in m."""
    half = distance / 2 / math.sqrt(2) * np.array([1.0, mirror, 0.0])
    return [CENTRE - half, CENTRE + half]


def joint_velocity(machine: Machine) -> Controller:
    return JointVelocity(JointVelocitySettings(map=JOINTS, expo=0.2), machine)


def end_effector(machine: Machine) -> Controller:
    return EndEffector(EndEffectorSettings(map=BASE), machine)


SCHEMES = {"joint_velocity": joint_velocity, "end_effector": end_effector}


class DelayedCrane:
    """The kinematic crane, which follows its commands late."""

    def __init__(self, run: Run, actuator: str) -> None:
        self.dynamics = KinematicCrane(
            CraneSettings(actuator=ACTUATOR_PRESETS[actuator]), run.machine
        )
        self.dynamics.open(run)
        self.dynamics.reset(run.machine.rest)

    @property
    def state(self) -> FloatArray:
        return self.dynamics.state()

    @property
    def tip(self) -> FloatArray:
        return self.state[8:11]

    def step(self, command: FloatArray) -> FloatArray:
        return self.dynamics.step(command, 1 / RATE_HZ)


@dataclass
class Done:
    """What became of a trial; times in s."""

    reached_s: float | None
    axes: FloatArray
    path: FloatArray
    first_push_s: float


@dataclass
class Loop:
    """The loop in small: operator, scheme and crane, one frame behind each other."""

    scheme: str = "joint_velocity"
    settings: Mapping[str, float] = field(default_factory=dict)
    machine: Machine = field(default_factory=ch8)
    participant_seed: int = 1
    actuator: str | None = None

    def __post_init__(self) -> None:
        self.controller = SCHEMES[self.scheme](self.machine)
        self.operator = SimulatedOperator(OperatorSettings(**self.settings))
        bare = make_run(
            self.machine,
            axes=self.operator.signals,
            command=self.controller.signals,
            task=TASK,
            inverse=self.controller.inverse,
        )
        self.run = Run(**(vars(bare) | {"participant_seed": self.participant_seed}))
        self.controller.open(self.run)
        self.operator.open(self.run)
        self.crane: IdealCrane | DelayedCrane = IdealCrane(self.machine, self.machine.rest)
        if self.actuator:
            self.crane = DelayedCrane(self.run, self.actuator)

    def show(self, number: int, task: object, **changes: object) -> Frame:
        due = number / RATE_HZ
        plain = {"phase": Phase.RUNNING, "trial": 1, "paused": False}
        return Frame(
            tick=Tick(number, due, due),
            elapsed=due,
            axes=np.zeros(self.run.axes.size),
            command=np.zeros(self.run.command.size),
            state=self.crane.state,
            task=np.array(task, dtype=float),
            **(plain | changes),
        )

    def trial(
        self,
        target: FloatArray | None,
        seed: int = 1,
        number: int = 1,
        limit_s: float = 30.0,
        pauses: tuple[range, ...] = (),
        rest_s: float = 0.2,
    ) -> Done:
        """Run until the tip has rested inside the target, as the aiming task asks."""
        trial = Trial(number, 1, seed, PlannedTrial({}, expected_s=10.0))
        self.operator.begin_trial(trial)
        self.controller.begin_trial(trial)
        shown = NOTHING_SHOWN if target is None else (*target, RADIUS)
        axes, path, quiet, pushed = [], [], 0, math.nan
        seen = self.show(0, NOTHING_SHOWN, phase=Phase.IDLE, trial=0)
        for tick in range(int(limit_s * RATE_HZ)):
            paused = any(tick in pause for pause in pauses)
            hands = self.operator.read(seen.tick, seen)
            axes.append(hands.copy())
            if math.isnan(pushed) and hands[[0, 1, 6, 7]].any():
                pushed = tick / RATE_HZ
            command = self.controller.command(hands, self.crane.state)
            state = self.crane.step(self.controller.idle() if paused else command)
            path.append(self.crane.tip.copy())
            seen = self.show(tick, NOTHING_SHOWN if paused else shown, trial=number, paused=paused)
            inside = target is not None and math.dist(path[-1], target) <= RADIUS
            quiet = quiet + 1 if inside and np.linalg.norm(state[-3:]) < 0.02 else 0
            if quiet >= rest_s * RATE_HZ:
                return Done(tick / RATE_HZ, np.array(axes), np.array(path), pushed)
        return Done(None, np.array(axes), np.array(path), pushed)
