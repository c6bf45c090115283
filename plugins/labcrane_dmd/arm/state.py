"""The state array of the arm: joints, tip, and everything in its scenes."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, Machine, ProtocolError, Signal
from labcrane.machines import Arm, Scene, place_objects, segments

if TYPE_CHECKING:
    from labcrane_dmd.arm.world import World


@dataclass(frozen=True, slots=True)
class Felt:
    """The entries of the state about one thing.

    Attributes
    ----------
    parts
        Those whose forces it has.
    moves
        Whether it moves; of what does not, there is no position.
    segments
        Those that move in joints, with the parts that may hit what is fixed.
    """

    parts: tuple[str, ...]
    moves: bool
    segments: tuple[str, ...]


Parts = Mapping[str, Felt]
"""The entries of the state about every thing, by its name."""

LIMIT_RAD = 1e-3
"""A joint this close to the end of its range is at the end."""

GRIP = {"thing": "1", "force": "N", "height": "m", "loose": "1", "slipped": "1", "left": "1"}
"""Which thing is held, counted from 1 in the order of the state; what pulls at it; how far it could
fall, or, once loose, fell past the jaws and could still fall; which thing is loose: no longer held
and still at the jaws; whether what came loose last slipped; how many things held have left."""


NOWHERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""Pose of an absent thing."""


def scene_parts(scenes: Iterable[Scene]) -> Parts:
    """Return what can move in any of the scenes, and what is fixed and has limits.

    A thing of the same name shares its columns.
    """
    found: dict[str, Felt] = {}
    for scene in scenes:
        for each in place_objects(scene, 0):
            moves = each.kind != "obstacle"
            names = [part.name for part in each.parts if moves or part.name in each.limits]
            if not names:
                continue
            before = found.get(each.name, Felt((), moves, ()))
            if before.moves != moves:
                raise ProtocolError(
                    f"{each.name!r} is fixed in one scene and moves in another; give one of them "
                    "another name"
                )
            jointed = [segment.name for segment in segments(each)[1:]]
            found[each.name] = Felt(
                tuple(dict.fromkeys((*before.parts, *names))),
                moves,
                tuple(dict.fromkeys((*before.segments, *jointed))),
            )
    return found


def arm_signals(machine: Machine, parts: Parts, links: tuple[str, ...]) -> tuple[Signal, ...]:
    """Return what the state holds, in order.

    ``joint.load`` is a fraction of the joint's effort, ``joint.overload`` and ``joint.end`` are
    -1, 0 or 1 (the end of the range at which the joint stands), ``valve.opening`` is the signal
    that the valve's opening stands for. A thing that is not in the trial's scene is at 0. What is
    fixed and has limits has a force only, that of the arm, and ``contact.fixed`` says with which of
    its links it presses on any of it.
    """
    scene = [signal for name, felt in parts.items() for signal in _thing_signals(name, felt)]
    if not all(felt.moves for felt in parts.values()):
        scene.append(Signal("contact.fixed", "N", links))
    grip = [Signal(f"grip.{word}", unit) for word, unit in GRIP.items()] if parts else []
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


def _thing_signals(name: str, felt: Felt) -> Iterator[Signal]:
    if not felt.moves:
        yield Signal(f"scene.{name}.force", "N", felt.parts)
        return
    yield from _pose_signals(name)
    yield Signal(f"scene.{name}.force", "N", felt.parts)
    yield Signal(f"scene.{name}.support", "N")
    if felt.segments:
        yield Signal(f"scene.{name}.hit", "N", felt.parts)
        yield Signal(f"scene.{name}.ground", "N", felt.parts)
    for segment in felt.segments:
        yield from _pose_signals(segment)


def _pose_signals(name: str) -> tuple[Signal, Signal]:
    return (
        Signal(f"scene.{name}.position", "m", ("x", "y", "z")),
        Signal(f"scene.{name}.orientation", "1", ("x", "y", "z", "w")),
    )


class ArmState:
    """One array that is refilled on every tick."""

    def __init__(self, machine: Machine, parts: Parts, links: tuple[str, ...]) -> None:
        self._links = links
        self._arm = Arm(machine)
        self._limits = machine.limits
        self._parts = parts
        moving = (name for name, felt in parts.items() if felt.moves)
        self._order = {name: number for number, name in enumerate(moving, start=1)}
        size = sum(len(signal.columns) for signal in arm_signals(machine, parts, links))
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
        contacts = world.contacts
        values: list[float] = []
        for name, felt in self._parts.items():
            standing = there.get(name)
            if standing is None or contacts is None:
                values += _absent(felt)
                continue
            pressed = [contacts.pressed.get((name, part), 0.0) for part in felt.parts]
            if not felt.moves:
                values += pressed
                continue
            position, orientation = world.where(standing.body)
            values += [*position, *orientation, *pressed, contacts.support[name]]
            if felt.segments:
                values += [contacts.hits.get((name, part), 0.0) for part in felt.parts]
                values += [contacts.grounds.get((name, part), 0.0) for part in felt.parts]
            for segment in felt.segments:
                if segment in standing.segments:
                    position, orientation = world.segment(standing, segment)
                    values += [*position, *orientation]
                else:
                    values += NOWHERE
        if not all(felt.moves for felt in self._parts.values()):
            fixed = {} if contacts is None else contacts.fixed
            values += [fixed.get(number, 0.0) for number in range(len(self._links))]
        grip = world.grip
        if grip is None:
            return [*values, *(0.0 for _ in GRIP)]
        numbers = [
            float(self._order[each.standing.placed.name]) if each else 0.0
            for each in (grip.held, grip.loose)
        ]
        held, loose = numbers
        counted = [float(grip.slipped), float(grip.left)]
        return [*values, held, grip.force, grip.height, loose, *counted]


def _absent(felt: Felt) -> list[float]:
    """Return the entries of the state about a thing that is not in the trial's scene."""
    forces = [0.0] * len(felt.parts)
    if not felt.moves:
        return forces
    values = [*NOWHERE, *forces, 0.0]
    if felt.segments:
        values += [*forces, *forces]
    for _ in felt.segments:
        values += NOWHERE
    return values
