"""The engine alone, with the settings that a crane needs: the minimum cost of a tick."""

import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self

from labcrane import Machine
from labcrane.machines import urdf_of

PASSES = 200
"""Solver passes with which PyBullet alone follows a crane's commands and keeps its limits."""


class BareEngine:
    """Set four motors, make one step and read four joints, without any code of labcrane.

    Parameters
    ----------
    machine
        The crane.
    rate_hz
        Ticks per second.
    passes
        Solver passes of a tick.
    """

    def __init__(self, machine: Machine, rate_hz: float, passes: int) -> None:
        from labcrane_bullet import bullet_crane as crane  # noqa: PLC0415
        from labcrane_bullet.engine import pybullet  # noqa: PLC0415

        self._engine = pybullet
        self._client = client = pybullet.connect(pybullet.DIRECT)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / rate_hz,
            numSolverIterations=passes,
            solverResidualThreshold=crane.RESIDUAL,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        pybullet.setGravity(0, 0, -crane.GRAVITY, physicsClientId=client)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "crane.urdf"
            path.write_text(urdf_of(machine))
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            self._body = pybullet.loadURDF(
                str(path), useFixedBase=True, flags=flags, physicsClientId=client
            )
        dampings = dict.fromkeys(("linearDamping", "angularDamping", "jointDamping"), 0.0)
        for joint, angle in enumerate(machine.rest):
            about = {"bodyUniqueId": self._body, "linkIndex": joint, "physicsClientId": client}
            pybullet.changeDynamics(**about, **dampings)
            pybullet.changeDynamics(**about, jointLimitForce=crane.LIMIT_FORCE)
            pybullet.resetJointState(self._body, joint, angle, 0.0, physicsClientId=client)
        self._efforts = [joint.effort for joint in machine.joints]
        self._joints = list(range(len(machine.joints)))
        self._number = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._engine.disconnect(self._client)

    def tick(self) -> None:
        """Make one tick; the direction changes every 480."""
        engine, client = self._engine, self._client
        speed = 0.1 if self._number // 480 % 2 else -0.1
        self._number += 1
        engine.setJointMotorControlArray(
            self._body, self._joints, engine.VELOCITY_CONTROL,
            targetVelocities=[speed] * len(self._joints), forces=self._efforts,
            physicsClientId=client,
        )  # fmt: skip
        engine.stepSimulation(physicsClientId=client)
        engine.getJointStates(self._body, self._joints, physicsClientId=client)
