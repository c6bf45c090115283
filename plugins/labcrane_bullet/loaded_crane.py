"""A crane with something on its tip: a payload, or a grapple that swings."""

from collections.abc import Sequence

from labcrane import FloatArray, Machine
from labcrane.core import LoadedCrane, LoadedCraneSettings
from labcrane_bullet.bullet_crane import BulletCrane
from labcrane_bullet.engine import pybullet

PASSES = 2000
"""Solver passes of a tick in which a motor has not the torque for a payload: a heavy tip takes more
of them than the crane alone. With 400, joints are off by 0.11 degrees within 3 s (ch8, 1 t)."""


class LoadedBulletCrane(LoadedCrane, BulletCrane):
    """The engine's crane with what hangs from its tip."""

    def __init__(self, settings: LoadedCraneSettings, machine: Machine) -> None:
        super().__init__(settings, machine)
        if settings.grapple is None:  # with one, every tick is the solver's, and few are strained
            self._passes = PASSES

    def _place(self, angles: Sequence[float]) -> None:
        super()._place(angles)
        if self._loaded.grapple is None:
            return
        self._hinges = (len(angles), len(angles) + 1)
        for hinge, angle in zip(self._hinges, (-self._load.pitch(angles), 0.0), strict=True):
            pybullet.changeDynamics(
                self._body,
                hinge,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=self._loaded.grapple.damping,
                physicsClientId=self._client,
            )
            # By default, every joint of the engine has a motor that brakes; switch it off.
            pybullet.setJointMotorControl2(
                self._body,
                hinge,
                pybullet.VELOCITY_CONTROL,
                force=0.0,
                physicsClientId=self._client,
            )
            pybullet.resetJointState(self._body, hinge, angle, 0.0, physicsClientId=self._client)

    def _enough(self, speeds: Sequence[float]) -> Sequence[float] | None:
        # Inverse dynamics know no joints without drives: a grapple's ticks are the solver's.
        return super()._enough(speeds) if self._loaded.grapple is None else None

    def _move(self, speeds: Sequence[float]) -> FloatArray:
        crane = super()._move(speeds)
        if self._loaded.grapple is None:
            return self._load.fill(crane)
        hinges = pybullet.getJointStates(self._body, self._hinges, physicsClientId=self._client)
        return self._load.fill(
            crane, [hinge[0] for hinge in hinges], [hinge[1] for hinge in hinges]
        )
