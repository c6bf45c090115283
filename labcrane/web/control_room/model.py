"""Model of the machine in a scene of NiceGUI: its bodies, and shapes around it."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.primitives import Cylinder, Shape, Sphere
from labcrane.machines.kinematics import link_frames
from labcrane.machines.machine import Body, Machine
from labcrane.machines.rotation import rotation_matrix

if TYPE_CHECKING:
    from nicegui import ui
    from nicegui.elements.scene.objects import Group
    from nicegui.elements.scene.scene_object3d import Object3D

PAINT = ("#8b949e", "#e6a817", "#2f8f4e")
"""Of the foot, the column, and the links behind; the last link is painted as the column."""

UPRIGHT = 1e-9
"""Below this a bar stands upright, and every direction across it is as good."""


class MachineModel:
    """The bodies of a machine, and shapes around it, in a scene of NiceGUI.

    Parameters
    ----------
    canvas
        The scene that it is drawn in.
    bodies
        What the machine looks like.
    """

    def __init__(self, canvas: "ui.scene", machine: Machine, bodies: Sequence[Body]) -> None:
        self._canvas = canvas
        self._machine = machine
        self._bodies = bodies
        self._groups = [self._draw(body) for body in bodies]
        self._shapes: dict[str, tuple[str, Object3D]] = {}

    def place(self, angles: Sequence[float], state: Mapping[str, float]) -> None:
        """Set the pose.

        Parameters
        ----------
        angles
            Of the joints, in rad.
        state
            What the machine's state holds, by column; where what it carries is.
        """
        frames = link_frames(self._machine, angles)
        for body, group in zip(self._bodies, self._groups, strict=True):
            if body.moves:
                where = [state.get(f"{body.moves}.position.{axis}", math.nan) for axis in "xyz"]
                turn = [state.get(f"{body.moves}.orientation.{q}", math.nan) for q in "xyzw"]
                known = all(map(math.isfinite, (*where, *turn)))
                group.visible(known)
                if known:
                    group.move(*where).rotate_R(rotation_matrix(turn).tolist())
            else:
                pose = frames[body.frame]
                group.move(*pose[:3, 3].tolist())
                group.rotate_R(pose[:3, :3].tolist())

    def show(self, shapes: Sequence[Shape]) -> None:
        """Show targets and what cues draw, and nothing else of them."""
        seen = set()
        for shape in shapes:
            seen.add(shape.name)
            self._shape(shape)
        for name, (_, drawn) in self._shapes.items():
            drawn.visible(name in seen)

    def remove(self) -> None:
        """Take everything out of the scene."""
        for group in self._groups:
            group.delete()
        for _, drawn in self._shapes.values():
            drawn.delete()

    def _draw(self, body: Body) -> "Group":
        with self._canvas, self._canvas.group() as group:
            x, y, z = body.size
            last = max(each.frame for each in self._bodies)
            paint = PAINT[1] if body.frame == last or body.moves else PAINT[min(body.frame, 2)]
            self._canvas.box(x, y, z).material(paint).move(*body.centre)
        return group.with_name(f"body {body.name}")

    def _shape(self, shape: Shape) -> None:
        red, green, blue, alpha = shape.colour
        colour = "#" + "".join(
            f"{round(255 * min(max(part, 0.0), 1.0)):02x}" for part in (red, green, blue)
        )
        kind = type(shape).__name__
        held = self._shapes.get(shape.name)
        if held is None or held[0] != kind:
            if held is not None:
                held[1].delete()
            with self._canvas:
                unit: Object3D = (
                    self._canvas.sphere(1.0)
                    if isinstance(shape, Sphere)
                    else self._canvas.cylinder(1.0, 1.0, 1.0, 24)
                )
            held = self._shapes[shape.name] = (kind, unit.with_name(shape.name))
        drawn = held[1]
        drawn.material(colour, opacity=alpha)
        if isinstance(shape, Cylinder):
            start, end = np.array(shape.start), np.array(shape.end)
            drawn.move(*((start + end) / 2).tolist())
            drawn.rotate_R(along_y(end - start))
            drawn.scale(shape.radius, float(np.linalg.norm(end - start)) or 1e-6, shape.radius)
        else:
            drawn.move(*shape.centre).scale(max(shape.radius, 1e-6))


def span(machine: Machine) -> float:
    """Return how far the machine at rest reaches along any axis, in metres."""
    return float(max(np.abs(pose[:3, 3]).max() for pose in link_frames(machine, machine.rest)))


def along_y(way: "np.ndarray") -> list[list[float]]:
    """Return the rotation that turns the y axis along ``way``, row by row."""
    length = float(np.linalg.norm(way))
    y = way / length if length else np.array([0.0, 1.0, 0.0])
    side = np.cross([0.0, 0.0, 1.0], y)
    across = float(np.linalg.norm(side))
    x = side / across if across > UPRIGHT else np.array([1.0, 0.0, 0.0])
    return [list(row) for row in np.column_stack([x, y, np.cross(x, y)]).tolist()]
