"""A crane with something on its tip: a payload, or a grapple that swings."""

from collections.abc import Mapping, Sequence

from labcrane import FloatArray, Machine
from labcrane.core import HangingLoad, LoadedCraneSettings, Value
from labcrane.machines import Body, urdf_of
from labcrane_bullet.bullet_crane import BulletCrane
from labcrane_bullet.engine import pybullet


class LoadedCrane(BulletCrane):
    """The crane's state with the load of every joint, and where the grapple is."""

    def __init__(self, settings: LoadedCraneSettings, machine: Machine) -> None:
        super().__init__(settings, machine)
        self._loaded = settings
        self._grapple = settings.grapple
        self._load = HangingLoad(machine, settings, self.signals)
        self.signals = self._load.signals

    def state(self) -> FloatArray:
        return self._load.values

    def reset(self, pose: Sequence[float]) -> None:
        super().reset(pose)
        self._load.fill(self._state.values, [0.0] * len(self._joints))

    def bodies(self) -> Sequence[Body]:
        return (*super().bodies(), *self._load.bodies())

    def metadata(self) -> Mapping[str, Value]:
        return {**super().metadata(), "hanging.mass_kg": self._loaded.hanging_kg}

    def _urdf(self) -> str:
        return urdf_of(self._machine, beyond=self._load.urdf())

    def _place(self, angles: Sequence[float]) -> None:
        super()._place(angles)
        if self._grapple is None:
            return
        self._hinges = (len(angles), len(angles) + 1)
        for hinge, angle in zip(self._hinges, (-self._load.pitch(angles), 0.0), strict=True):
            pybullet.changeDynamics(
                self._body,
                hinge,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=self._grapple.damping,
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

    def _move(self, speeds: Sequence[float]) -> FloatArray:
        # Inverse dynamics know no joints without drives: every tick is the solver's.
        self._solve(targetVelocities=speeds)
        self._step()
        states = self._read()
        crane = self._state.fill([state[0] for state in states], [state[1] for state in states])
        loads = [
            state[3] / joint.effort
            for state, joint in zip(states, self._machine.joints, strict=True)
        ]
        if self._grapple is None:
            return self._load.fill(crane, loads)
        hinges = pybullet.getJointStates(self._body, self._hinges, physicsClientId=self._client)
        return self._load.fill(
            crane, loads, [hinge[0] for hinge in hinges], [hinge[1] for hinge in hinges]
        )
