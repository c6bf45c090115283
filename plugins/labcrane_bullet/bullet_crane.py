"""A crane moved by PyBullet, with the settings that make it follow its commands."""

import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path

from labcrane import FloatArray, Machine, PluginError, Run
from labcrane.core import Crane, CraneSettings, Kernel, Value
from labcrane.machines import GRAVITY, points_in_numbers, urdf_of
from labcrane_bullet.engine import pybullet

ITERATIONS = 400
"""Solver passes of a tick in which the solver is needed. A crane stretched out level under its own
weight creeps by 2.6 degrees in 10 s with the engine's 50, by 0.024 with 200 and by less than 0.0001
with 400 (ch8, 240 Hz)."""

RESIDUAL = 0.0
"""All passes are made: with any threshold, joints go further through their limits."""

TORQUE = 3
"""Index of the motor's torque in the engine's joint state."""

ALL = 1.0 - 1e-9
"""Proportion of its torque at which a motor counts as giving its maximum; the solver rounds."""

LIMIT_FORCE = 1e7
"""In N m. The engine's own is 24 kN m at 240 Hz, through which a crane's drives push any joint; the
URDF's effort is not used for it (bullet3 #2944)."""


class BulletCrane(Crane):
    """Velocity motors that hold against gravity up to each joint's effort.

    In an ordinary tick the torques that give the speeds asked for are worked out, and no solver is
    needed. When one of them is more than its motor has, or a joint is beyond its limit, the
    engine's motors and its solver find out what happens. Without gravity, motors could follow other
    commands.

    Every reset restarts the engine: setting joints by hand leaves contact and solver caches behind,
    and the same commands would then not give the same bits.
    """

    has_drives = True
    _passes = ITERATIONS

    def __init__(self, settings: CraneSettings, machine: Machine) -> None:
        super().__init__(settings, machine)
        self._joints = tuple(range(len(machine.joints)))
        self._efforts = tuple(joint.effort for joint in machine.joints)
        self._no_efforts = (0.0,) * len(machine.joints)
        self._bounds = tuple(
            (number, *joint.limits, joint.effort) for number, joint in enumerate(machine.joints)
        )
        self._client: int | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def open(self, run: Run) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="labcrane-")
        self._file = Path(self._folder.name) / "crane.urdf"
        self._file.write_text(self._urdf(), encoding="utf-8")
        super().open(run)

    def close(self) -> None:
        self._disconnect()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def metadata(self) -> Mapping[str, Value]:
        return {**super().metadata(), "engine": f"pybullet {version('pybullet')}"}

    def kernel(self) -> Kernel | None:
        return self.engine_kernel()

    def _motion(self) -> tuple[Sequence[float], Sequence[float]]:
        return self._angles, self._speeds

    def _stand(self, angles: Sequence[float], speeds: Sequence[float]) -> None:
        self._angles, self._speeds = list(angles), list(speeds)
        for joint, angle, speed in zip(self._joints, angles, speeds, strict=True):
            pybullet.resetJointState(self._body, joint, angle, speed, physicsClientId=self._client)

    def _urdf(self) -> str:
        return urdf_of(self._machine)

    def _place(self, angles: Sequence[float]) -> None:
        self._disconnect()
        client = pybullet.connect(pybullet.DIRECT)
        if client < 0:
            raise PluginError(
                "PyBullet could not start another engine; close other programs that use it"
            )
        self._client = client
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self._dt,
            numSubSteps=0,
            numSolverIterations=self._passes,
            solverResidualThreshold=RESIDUAL,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        with points_in_numbers():
            body = pybullet.loadURDF(
                str(self._file),
                useFixedBase=True,
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=client,
            )
        self._body = body
        for joint, angle in zip(self._joints, angles, strict=True):
            _prepare(body, joint, client)
            pybullet.resetJointState(body, joint, angle, 0.0, physicsClientId=client)
        self._angles, self._speeds = list(angles), [0.0] * len(self._joints)
        self._motors_on = True
        # One call moves all joints and one reads them; a call per joint costs three times more.
        motors = partial(
            pybullet.setJointMotorControlArray, body, self._joints, physicsClientId=client
        )
        self._solve = partial(motors, pybullet.VELOCITY_CONTROL, forces=self._efforts)
        self._let_go = partial(motors, pybullet.VELOCITY_CONTROL, forces=self._no_efforts)
        self._push = partial(motors, pybullet.TORQUE_CONTROL)
        self._torques = partial(pybullet.calculateInverseDynamics, body, physicsClientId=client)
        self._step = partial(pybullet.stepSimulation, physicsClientId=client)
        self._read = partial(pybullet.getJointStates, body, self._joints, physicsClientId=client)

    def _move(self, speeds: Sequence[float]) -> FloatArray:
        torques = self._enough(speeds)
        if torques is not None:
            if self._motors_on:
                self._let_go()
                self._motors_on = False
            self._push(forces=torques)
        else:
            self._solve(targetVelocities=speeds)
            self._motors_on = True
        self._step()
        states = self._read()
        self._angles = [state[0] for state in states]
        self._speeds = [state[1] for state in states]
        if torques is not None:
            return self._state.fill(self._angles, self._speeds, self._loads(torques))
        loads = self._loads([state[TORQUE] for state in states])
        saturated = [float(load >= ALL) - float(load <= -ALL) for load in loads]
        return self._state.fill(self._angles, self._speeds, loads, saturated)

    def _loads(self, torques: Sequence[float]) -> list[float]:
        """Return torques in N m as shares of the joints' efforts."""
        return [torque / effort for torque, effort in zip(torques, self._efforts, strict=True)]

    def _enough(self, speeds: Sequence[float]) -> Sequence[float] | None:
        """Return the torques that give joints these speeds; None where the solver is needed.

        That is where a motor has not the torque, or a joint is beyond its limits.
        """
        dt, before, angles = self._dt, self._speeds, self._angles
        change = [(speed - was) / dt for speed, was in zip(speeds, before, strict=True)]
        torques: Sequence[float] = self._torques(angles, before, change)
        for joint, lowest, highest, effort in self._bounds:
            if not (lowest <= angles[joint] <= highest and -effort <= torques[joint] <= effort):
                return None
        return torques

    def _disconnect(self) -> None:
        if self._client is not None:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = None


def _prepare(body: int, joint: int, client: int) -> None:
    # The limit's force goes alone: settings in one call can displace each other (bullet3 #4133).
    pybullet.changeDynamics(
        body,
        joint,
        linearDamping=0.0,
        angularDamping=0.0,
        jointDamping=0.0,
        physicsClientId=client,
    )
    pybullet.changeDynamics(body, joint, jointLimitForce=LIMIT_FORCE, physicsClientId=client)
