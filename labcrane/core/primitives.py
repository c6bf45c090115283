"""Primitives that a cue draws, in the machine's base frame, the same for every view."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from labcrane.core.signals import Layout

if TYPE_CHECKING:
    from labcrane.types import FloatArray

Point = tuple[float, float, float]
Colour = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere.

    Attributes
    ----------
    name
        Its name, unique in a picture: it names its box for eye tracking.
    centre, radius
        In metres.
    colour
        Red, green, blue and opacity, each 0 to 1.
    """

    name: str
    centre: Point
    radius: float
    colour: Colour


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A round bar.

    Attributes
    ----------
    name
        Its name, unique in a picture: it names its box for eye tracking.
    start, end
        The middles of its two ends, x, y and z in metres.
    radius
        In metres.
    colour
        Red, green, blue and opacity, each 0 to 1.
    """

    name: str
    start: Point
    end: Point
    radius: float
    colour: Colour


Shape = Sphere | Cylinder
"""Shapes that a cue may draw."""

TARGET: Colour = (0.90, 0.12, 0.10, 0.85)
OTHER: Colour = (0.92, 0.92, 0.88, 0.55)

POSITION, RADIUS = "position", "radius"
SMALL = 0.15
"""Radius in metres of a target whose task says none."""


class TargetFinder:
    """Finds a task's targets among its signals.

    Every signal ``name.position`` in metres is the centre of a target, ``name.radius`` its radius;
    one without a radius is as large as the first one that has one. ``target`` is where to go.
    """

    def __init__(self, task: Layout) -> None:
        self._places = {
            signal.name.rpartition(".")[0]: task.find(signal.name)
            for signal in task.signals
            if signal.name.rpartition(".")[2] == POSITION and len(signal.components) == len("xyz")
        }
        self._radii = {
            signal.name.rpartition(".")[0]: task.index(signal.name)
            for signal in task.signals
            if signal.name.rpartition(".")[2] == RADIUS
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all possible targets."""
        return tuple(self._places)

    def find(self, task: FloatArray) -> Iterator[Sphere]:
        """Yield the targets in a task's values, shape ``(n_task,)``; none between trials."""
        usual = next((float(task[index]) for index in self._radii.values()), SMALL)
        for name, place in self._places.items():
            x, y, z = (float(value) for value in task[place])
            if math.isfinite(x + y + z):
                radius = float(task[self._radii[name]]) if name in self._radii else usual
                yield Sphere(name, (x, y, z), radius, TARGET if name == "target" else OTHER)
