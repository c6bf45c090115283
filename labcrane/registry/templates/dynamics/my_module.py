"""my_part: a machine to operate."""

from collections.abc import Sequence

import numpy as np
from pydantic import PositiveFloat

from labcrane import Dynamics, FloatArray, Machine, Offer, Run, Settings, Signal, hookimpl, offer
from labcrane.machines import Arm, Body, jacobian

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    lag_s: PositiveFloat = 0.1
    """Time in which a joint reaches 63 % of the speed asked for, in seconds."""


class MyPart(Dynamics):
    """Joints that follow their command with a lag, and stop at their limits."""

    def __init__(self, settings: MyPartSettings, machine: Machine) -> None:
        self._settings = settings
        self._machine = machine
        self._lowest, self._highest = np.array(machine.limits).T
        # Tasks and views look for these four.
        self.signals = (
            Signal("joint.angle", "rad", machine.names),
            Signal("joint.velocity", "rad/s", machine.names),
            Signal("tip.position", "m", ("x", "y", "z")),
            Signal("tip.velocity", "m/s", ("x", "y", "z")),
        )
        self.reset(machine.rest)

    def open(self, run: Run) -> None:
        self._command = run.command.find("command")

    def reset(self, pose: Sequence[float]) -> None:
        self._angles = np.array(pose, dtype=float)
        self._speeds = np.zeros(len(pose))

    def step(self, command: FloatArray, dt: float) -> FloatArray:
        share = 1.0 - np.exp(-dt / self._settings.lag_s)
        self._speeds += share * (command[self._command] - self._speeds)
        angles = np.clip(self._angles + self._speeds * dt, self._lowest, self._highest)
        self._speeds = (angles - self._angles) / dt
        self._angles = angles
        return self.state()

    def state(self) -> FloatArray:
        angles = self._angles.tolist()
        velocity = jacobian(self._machine, angles) @ self._speeds
        tip = Arm(self._machine).tip(angles)
        return np.concatenate([self._angles, self._speeds, tip, velocity])

    def bodies(self) -> Sequence[Body]:
        # A bar along each link; a link's frame sits at its far end, its x axis along the link.
        links = enumerate(self._machine.joints, start=1)
        return [
            Body(link.name, i, (link.a + 0.2, 0.2, 0.2), (-link.a / 2, 0, 0)) for i, link in links
        ]


@hookimpl
def labcrane_dynamics() -> list[Offer[Dynamics]]:
    return [offer("my_part", MyPartSettings, MyPart)]
