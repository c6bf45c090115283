"""Surroundings of the machine: objects and the human figure, where they are now."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from labcrane.machines.human_figure import Geom, ShapeKind
from labcrane.machines.jointed_body import Segment, beside, segments, stands
from labcrane.machines.rotation import rotation_matrix
from labcrane.machines.scene import PlacedObject
from labcrane.machines.scene_codec import read_placed

if TYPE_CHECKING:
    from nicegui import ui
    from nicegui.elements.scene.objects import Group
    from nicegui.elements.scene.scene_object3d import Object3D

Rows = list[list[float]]

PAINT = {"object": "#92400e", "obstacle": "#6b7280", "body": "#be185d"}
UPRIGHT: Rows = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
"""Turns a cylinder, which three.js lays along y, along z."""
LYING: Rows = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
"""Turns it along x."""


class Surroundings:
    """Draws what the running trial's task has placed; nothing between trials.

    What it is made of is in the event ``scene.placed``; where it is now, in the state's signals
    ``scene.NAME.position`` and ``.orientation``. What has none stays where it was placed.
    """

    def __init__(self, canvas: "ui.scene") -> None:
        self._canvas = canvas
        self._drawn = ""
        self._groups: dict[str, Group] = {}

    def update(self, things: str, newest: Mapping[str, float]) -> None:
        """Show what is placed, where it is in the newest frame, by the frame's columns."""
        if things != self._drawn:
            self._drawn = things
            for group in self._groups.values():
                group.delete()
            self._groups = {
                segment.name: self._draw(placed, segment)
                for placed in read_placed(things)
                for segment in segments(placed)
            }
        for name, group in self._groups.items():
            where = [newest.get(f"state.scene.{name}.position.{axis}", math.nan) for axis in "xyz"]
            turn = [newest.get(f"state.scene.{name}.orientation.{q}", math.nan) for q in "xyzw"]
            if all(map(math.isfinite, (*where, *turn))):
                group.move(*where)
                group.rotate_R(rotation_matrix(turn).tolist())

    def _draw(self, placed: PlacedObject, segment: Segment) -> "Group":
        first = segment.parts[0]
        with self._canvas, self._canvas.group() as group:
            for part in segment.parts:
                self._part(beside(first, part), PAINT[placed.kind])
        where, yaw = stands(placed, first)
        group.with_name(segment.name).move(*where)
        group.rotate_R(_about_z(yaw))
        return group

    def _part(self, part: Geom, colour: str) -> None:
        canvas, (x, y, z) = self._canvas, part.size
        turn = np.array(_about_z(part.yaw))
        match part.shape:
            case ShapeKind.BOX | ShapeKind.HULL:  # three.js on the page has no solid of points
                shape: Object3D = canvas.box(x, y, z)
            case ShapeKind.SPHERE:
                shape = canvas.sphere(x / 2)
            case ShapeKind.CYLINDER:
                shape, turn = canvas.cylinder(x / 2, x / 2, z, 24), turn @ UPRIGHT
            case _:
                shape, turn = canvas.cylinder(y / 2, y / 2, x, 16), turn @ LYING
        shape.material(colour).move(*part.centre).rotate_R(turn.tolist())


def _about_z(yaw: float) -> Rows:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
