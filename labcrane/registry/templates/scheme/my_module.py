"""my_part: from the operator's axes to joint speeds."""

from typing import Annotated

import numpy as np
from pydantic import Field

from labcrane import Controller, FloatArray, Machine, Offer, Run, Settings, Signal, hookimpl, offer
from labcrane.core import Names, Once, Reference
from labcrane.machines import jacobian

labcrane_api = 1

Axis = Annotated[str, Reference("axis")]
"""An axis of the input: `labcrane check` looks it up."""


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    axes: Annotated[tuple[Axis, ...], Once()] = ("left.x", "right.y", "left.y", "right.x")
    """The axis that turns each joint, in the order of the machine's joints."""

    speed: float = Field(default=0.5, gt=0.0, le=1.0)
    """Share of each joint's full speed that a full push asks for."""

    def needs(self, machine: Machine) -> Names:
        """Return what has to be there though no protocol writes it: the axes by default."""
        return {"axis": self.axes}


class MyPart(Controller):
    """Each axis turns one joint."""

    def __init__(self, settings: MyPartSettings, machine: Machine) -> None:
        self._settings = settings
        self._machine = machine
        self._full = settings.speed * np.array(machine.speeds)
        # What command returns: rad/s per joint. Append signals for whatever else is to be recorded.
        self.signals = (Signal("command", "rad/s", machine.names),)

    def open(self, run: Run) -> None:
        self._axes = [run.axes.index(name) for name in self._settings.axes]
        self._n_axes = run.axes.size
        self._angle = run.state.find("joint.angle")

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        return axes[self._axes] * self._full

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        """Undo command: what a simulated operator does to move the tip at ``velocity``."""
        to_tip = jacobian(self._machine, state[self._angle].tolist())
        share = np.linalg.pinv(to_tip, rcond=0.05) @ velocity / self._full
        axes = np.zeros(self._n_axes)
        axes[self._axes] = share / max(1.0, np.abs(share).max())
        return axes


@hookimpl
def labcrane_controllers() -> list[Offer[Controller]]:
    return [offer("my_part", MyPartSettings, MyPart)]
