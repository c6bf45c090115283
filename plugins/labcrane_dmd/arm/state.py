"""The state array of the arm: joints, tip, and everything in its scenes."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, Machine, Signal
from labcrane.machines import Arm, Scene, place_objects

if TYPE_CHECKING:
    from labcrane_dmd.arm.world import World

Parts = Mapping[str, tuple[str, ...]]
"""The parts of every thing that can move, by its name."""

LIMIT_RAD = 1e-3
"""A joint this close to the end of its range stands there."""

GRIP = (("thing", "1"), ("force", "N"), ("drops", "1"))
"""Which thing is held, counted from 1 in the order of the state, what pulls at it, and how often
something slipped out."""


def scene_parts(scenes: Iterable[Scene]) -> Parts:
    """Return what can move in any of the scenes; a thing of the same name shares its columns."""
    found: dict[str, tuple[str, ...]] = {}
    for scene in scenes:
        for each in place_objects(scene, 0):
            if each.kind != "obstacle":
                found[each.name] = tuple(dict.fromkeys(part.name for part in each.parts))
    return found


def arm_signals(machine: Machine, parts: Parts) -> tuple[Signal, ...]:
    """Return what the state holds, in order.

    ``joint.load`` is a fraction of the joint's effort, ``joint.overload`` and ``joint.end`` are
    -1, 0 or 1 (the end of the range at which the joint stands), ``valve.opening`` is the signal
    that the valve's opening stands for. A thing that is not in the trial's scene is at 0.
    """
    scene = [
        signal
        for name, regions in parts.items()
        for signal in (
            Signal(f"scene.{name}.position", "m", ("x", "y", "z")),
            Signal(f"scene.{name}.orientation", "1", ("x", "y", "z", "w")),
            Signal(f"scene.{name}.force", "N", regions),
            Signal(f"scene.{name}.support", "N"),
        )
    ]
    grip = [Signal(f"grip.{word}", unit) for word, unit in GRIP] if parts else []
    return (
        Signal("joint.angle", "rad", machine.names),
        Signal("joint.velocity", "rad/s", machine.names),
        Signal("tip.position", "m", ("x", "y", "z")),
        Signal("tip.velocity", "m/s", ("x", "y", "z")),
        Signal("joint.load", "1", machine.names),
        Signal("joint.overload", "1", machine.names),
        Signal("joint.end", "1", machine.names),
        Signal("valve.opening", "1", machine.names),
        *scene,
        *grip,
    )


class ArmState:
    """One array that is filled anew on every tick."""

    def __init__(self, machine: Machine, parts: Parts) -> None:
        self._arm = Arm(machine)
        self._limits = machine.limits
        self._parts = parts
        self._order = {name: number for number, name in enumerate(parts, start=1)}
        size = sum(len(signal.columns) for signal in arm_signals(machine, parts))
        self.values: FloatArray = np.zeros(size)

    def fill(
        self,
        angles: Sequence[float],
        speeds: Sequence[float],
        loads: Sequence[float],
        overloads: Sequence[int],
        openings: Sequence[float],
        world: "World",
    ) -> FloatArray:
        """Return the state after a tick."""
        ends = [
            -1.0 if angle < lowest + LIMIT_RAD else 1.0 if angle > highest - LIMIT_RAD else 0.0
            for angle, (lowest, highest) in zip(angles, self._limits, strict=True)
        ]
        self.values[:] = (
            *angles,
            *speeds,
            *self._arm.tip(angles),
            *self._tip_velocity(angles, speeds),
            *loads,
            *overloads,
            *ends,
            *openings,
            *self._scene(world),
        )
        return self.values

    def _tip_velocity(
        self, angles: Sequence[float], speeds: Sequence[float]
    ) -> tuple[float, float, float]:
        columns = self._arm.planar_jacobian(angles)
        outward = sum(column[0] * speed for column, speed in zip(columns, speeds[1:], strict=True))
        upward = sum(column[1] * speed for column, speed in zip(columns, speeds[1:], strict=True))
        sideways = -columns[0][1] * speeds[0]
        bearing = self._arm.bearing(angles)
        ahead, left = math.cos(bearing), math.sin(bearing)
        return outward * ahead - sideways * left, outward * left + sideways * ahead, upward

    def _scene(self, world: "World") -> list[float]:
        if not self._parts:
            return []
        there = {each.placed.name: each for each in world.things}
        values: list[float] = []
        for name, parts in self._parts.items():
            if name not in there or world.contacts is None:
                values += [0.0] * (3 + 3) + [1.0] + [0.0] * (len(parts) + 1)
                continue
            position, orientation = world.where(there[name].body)
            pressed = world.contacts.pressed
            values += [*position, *orientation]
            values += [pressed.get((name, part), 0.0) for part in parts]
            values.append(world.contacts.support[name])
        grip = world.grip
        if grip is None:
            return [*values, 0.0, 0.0, 0.0]
        held = self._order[grip.held.standing.placed.name] if grip.held else 0
        return [*values, float(held), grip.force, float(grip.drops)]
