"""The machine in three dimensions, from its joint angles."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from labcrane.machines.kinematics import link_frames
from labcrane.machines.machine import Machine
from labcrane.web.page import PageContext
from labcrane.web.surroundings import Surroundings

RATE_S = 0.1
THICK = 0.04
"""Of a beam, as a share of the machine's reach."""

UPRIGHT = 1e-9
"""Below this a link stands upright, and every direction across it is as good."""

TARGET = tuple(f"task.target.position.{axis}" for axis in "xyz")


class Scene:
    """Draws a beam for each link, the tip, the target if there is one, and what stands around."""

    def __init__(self, context: PageContext) -> None:
        self._context = context

    def build(self) -> None:
        """Build it where the page stands, and keep it up to date."""
        from nicegui import ui  # noqa: PLC0415 - loads for a second

        machine = self._context.study.machine
        rest = machine.rest
        points = _points(machine, rest)
        span = float(np.abs(points).max())
        thick = THICK * span
        with ui.scene(grid=(round(2 * span), 20), background_color="#eef2f6").classes(
            "w-full h-72"
        ) as scene:
            self._beams = [
                scene.box(float(np.linalg.norm(b - a)) or 0.01, thick, thick).material("#b45309")
                for a, b in itertools.pairwise(points)
            ]
            self._tip = scene.sphere(thick / 2).material("#111827")
            self._target = scene.sphere(0.8 * thick).material("#15803d", opacity=0.6)
        scene.move_camera(
            x=1.1 * span, y=-1.6 * span, z=1.1 * span, look_at_z=0.2 * span, duration=0
        )
        self._surroundings = Surroundings(self._context, scene)
        self._place(points)
        ui.timer(RATE_S, self._update)

    def _update(self) -> None:
        machine, newest = self._context.study.machine, self._context.live.newest
        angles = [newest.get(f"state.joint.angle.{name}") for name in machine.names]
        given = [angle for angle in angles if angle is not None]
        if len(given) == len(angles):
            self._place(_points(machine, given))
        self._surroundings.update()

    def _place(self, points: "Sequence[np.ndarray]") -> None:
        for beam, a, b in zip(self._beams, points, points[1:], strict=False):
            beam.move(*((a + b) / 2).tolist())
            beam.rotate_R(_along(b - a))
        self._tip.move(*points[-1].tolist())
        where = [self._context.live.newest.get(name, math.nan) for name in TARGET]
        known = all(map(math.isfinite, where))
        self._target.visible(known)
        if known:
            self._target.move(*where)


def _points(machine: Machine, angles: Sequence[float]) -> "list[np.ndarray]":
    """Return where the joints are, shape ``(3,)`` each, in m, base first."""
    return [pose[:3, 3] for pose in link_frames(machine, angles)]


def _along(way: "np.ndarray") -> list[list[float]]:
    """Return the rotation that turns the x axis along ``way``, row by row."""
    length = float(np.linalg.norm(way))
    x = way / length if length else np.array([1.0, 0.0, 0.0])
    side = np.cross([0.0, 0.0, 1.0], x)
    across = float(np.linalg.norm(side))
    y = side / across if across > UPRIGHT else np.array([0.0, 1.0, 0.0])
    return [list(row) for row in np.column_stack([x, y, np.cross(x, y)]).tolist()]
