"""A crane with something on its tip: a payload, or a grapple that swings."""

from collections.abc import Sequence

from labcrane import FloatArray
from labcrane.core import LoadedCrane
from labcrane_bullet.bullet_crane import BulletCrane
from labcrane_bullet.engine import pybullet


class LoadedBulletCrane(LoadedCrane, BulletCrane):
    """The engine's crane with the load of every joint, and where the grapple is."""

    def twin(self) -> None:
        return None  # what hangs on it swings by the engine's law

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
            # Every joint of the engine has a motor that brakes until it is told not to.
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
        torques = self._push_to(speeds)
        crane = self._state.fill(self._angles, self._speeds)
        loads = [torque / effort for torque, effort in zip(torques, self._efforts, strict=True)]
        if self._loaded.grapple is None:
            return self._load.fill(crane, loads)
        hinges = pybullet.getJointStates(self._body, self._hinges, physicsClientId=self._client)
        return self._load.fill(
            crane, loads, [hinge[0] for hinge in hinges], [hinge[1] for hinge in hinges]
        )
