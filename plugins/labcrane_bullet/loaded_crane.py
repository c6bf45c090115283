"""A crane with something on its tip: a payload, or a grapple that swings."""

from collections.abc import Mapping, Sequence

import numpy as np

from labcrane import FloatArray, Machine, Signal
from labcrane.core import Value
from labcrane.machines import Body
from labcrane_bullet.bullet_crane import BulletCrane
from labcrane_bullet.engine import pybullet
from labcrane_bullet.hanging import hanging, place, total_kg
from labcrane_bullet.settings import BulletSettings

WAYS = ("along", "across")


class LoadedCrane(BulletCrane):
    """The crane's state with the load of every joint, and where the grapple is.

    ``joint.load`` is the drive's torque as a share of the joint's effort, with its sign. Swings
    count from hanging straight down: ``along`` outward, ``across`` to the left.
    """

    def __init__(self, settings: BulletSettings, machine: Machine) -> None:
        super().__init__(settings, machine)
        self._loaded = settings
        self._grapple = settings.grapple
        self._bare = self.signals
        self.signals = (*self._bare, Signal("joint.load", "1", machine.names))
        if self._grapple:
            self.signals += (
                Signal("grapple.swing", "rad", WAYS),
                Signal("grapple.swing_rate", "rad/s", WAYS),
                Signal("grapple.position", "m", ("x", "y", "z")),
                Signal("grapple.orientation", "1", ("x", "y", "z", "w")),
            )
        self._values: FloatArray = np.zeros(sum(len(signal.columns) for signal in self.signals))

    def state(self) -> FloatArray:
        return self._values

    def reset(self, pose: Sequence[float]) -> None:
        super().reset(pose)
        self._fill([0.0] * len(self._joints), (0.0, 0.0), (0.0, 0.0))

    def bodies(self) -> Sequence[Body]:
        if self._grapple is None:
            return super().bodies()
        edge, long = self._grapple.size_m, self._grapple.length_m
        rod = (0.12 * edge, 0.12 * edge, long)
        return (
            *super().bodies(),
            Body("grapple", 0, (edge, edge, edge), (0.0, 0.0, 0.0), moves="grapple"),
            Body("grapple rod", 0, rod, (0.0, 0.0, 0.5 * long), moves="grapple"),
        )

    def metadata(self) -> Mapping[str, Value]:
        return {**super().metadata(), "hanging.mass_kg": total_kg(self._loaded)}

    def _urdf(self) -> str:
        text = super()._urdf()
        return text.replace("</robot>", hanging(self._machine, self._loaded) + "</robot>")

    def _place(self, angles: Sequence[float]) -> None:
        super()._place(angles)
        if self._grapple is None:
            return
        self._hinges = (len(angles), len(angles) + 1)
        for hinge, angle in zip(self._hinges, (-self._pitch(angles), 0.0), strict=True):
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
        self._state.fill([state[0] for state in states], [state[1] for state in states])
        loads = [
            state[3] / joint.effort
            for state, joint in zip(states, self._machine.joints, strict=True)
        ]
        if self._grapple is None:
            return self._fill(loads, (0.0, 0.0), (0.0, 0.0))
        pitch = self._pitch([state[0] for state in states])
        pitching = sum(state[1] for state in states[1:])
        swivel, across = pybullet.getJointStates(
            self._body, self._hinges, physicsClientId=self._client
        )
        swing = (-(swivel[0] + pitch), across[0])
        return self._fill(loads, swing, (-(swivel[1] + pitching), across[1]))

    def _fill(
        self, loads: Sequence[float], swing: tuple[float, float], rate: tuple[float, float]
    ) -> FloatArray:
        crane = self._state.values
        values = [*crane.tolist(), *loads]
        if self._grapple:
            joints = len(self._joints)
            bearing = values[0] + self._machine.joints[0].offset
            tip = values[2 * joints : 2 * joints + 3]
            values += [*swing, *rate, *place(self._grapple, tip, bearing, *swing)]
        self._values[:] = values
        return self._values

    def _pitch(self, angles: Sequence[float]) -> float:
        """Return how far the last link points down, in rad."""
        chain = zip(angles[1:], self._machine.joints[1:], strict=True)
        return sum(angle + joint.offset for angle, joint in chain)
