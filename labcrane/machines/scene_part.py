"""Library parts: things of several shapes, each in a file of its own that scenes use."""

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    ValidationInfo,
    model_validator,
)

from labcrane.files.model import StrictModel
from labcrane.files.yaml import YamlFile
from labcrane.machines.human_figure import Geom, Point, ShapeKind
from labcrane.machines.meshes.mesh_file import Looks

FEWEST = 4
"""Points that a solid has at least."""


class PartShape(StrictModel):
    """One shape of a library part."""

    shape: Literal["box", "cylinder", "sphere", "hull"]
    """A cylinder stands upright; a hull is the smallest solid without hollows around its points."""

    size: Point = (0.0, 0.0, 0.0)
    """Edge lengths in metres; a cylinder's and a sphere's first is the diameter, a cylinder's last
    the height. A hull has none."""

    points: tuple[Point, ...] = ()
    """Corners of a hull, about its centre, in metres."""

    centre: Point
    """In the part's frame, whose origin is where a scene places it, in metres."""

    yaw_deg: float = 0.0
    """Turned to the left, in degrees."""

    limit_n: PositiveFloat | None = None
    """Contact force, in newtons, beyond which touching this shape is a mistake; the whole part's
    by default."""

    mesh: Looks | None = None
    """What it looks like instead, in a frame at its centre; its touch is the same."""

    @model_validator(mode="after")
    def _has_an_extent(self) -> "PartShape":
        if self.shape == "hull":
            if len(self.points) < FEWEST or any(self.size):
                raise ValueError(f"a hull has {FEWEST} points or more, and no size")
        elif self.points or min(self.size) <= 0.0:
            raise ValueError(f"a {self.shape} has a size of three lengths, and no points")
        return self


class Part(StrictModel):
    """A thing of a library: what it is of, and how it may be touched."""

    labcrane_part: Literal[1]
    """Version of the format."""

    title: str
    """What it is, for people."""

    shapes: dict[str, PartShape] = Field(min_length=1)
    """By name; forces are recorded, and limits hold, for each."""

    fixed: bool = False
    """Whether it is an obstacle, which nothing moves."""

    carries: bool = False
    """Whether somebody may lie on it: what rests on it is no hit against it."""

    mass_kg: PositiveFloat = 1.0
    """Its mass, in kilograms; an obstacle's does not matter."""

    friction: NonNegativeFloat = 0.6
    """Coefficient of friction, a share of the force that presses."""

    limit_n: PositiveFloat | None = None
    """Contact force, in newtons, beyond which touching it is a mistake; none by default."""

    slip_n: PositiveFloat = 400.0
    """Force, in newtons, at which it slips out of the jaws."""

    source: str = ""
    """Where its sizes and limits come from."""

    def geoms(self) -> tuple[Geom, ...]:
        """Return its shapes."""
        return tuple(
            Geom(
                name,
                ShapeKind(each.shape),
                each.size if each.shape != "hull" else _extent(each.points),
                each.centre,
                math.radians(each.yaw_deg),
                each.mesh,
                each.points,
            )
            for name, each in self.shapes.items()
        )

    def limits(self) -> dict[str, float]:
        """Return the largest force on each shape that has one, in N."""
        found = {name: each.limit_n or self.limit_n for name, each in self.shapes.items()}
        return {name: limit for name, limit in found.items() if limit is not None}


def load_part(path: Path) -> Part:
    """Read a library part; every mistake gets its line."""
    return YamlFile.read(path).checked(Part)


def _used(path: Path, info: ValidationInfo) -> Path:
    return info.context["folder"] / path if info.context else path


PartFile = Annotated[Path, AfterValidator(_used)]
"""A library part, by its path from the file that uses it."""


def lowest(part: Geom) -> float:
    """Return how far a shape's lowest point is below its thing's origin, in m."""
    if part.shape is ShapeKind.SPHERE:
        return 0.5 * part.size[0] - part.centre[2]
    if part.points:
        return -min(z for _, _, z in part.points) - part.centre[2]
    return 0.5 * part.size[2] - part.centre[2]


def _extent(points: tuple[Point, ...]) -> Point:
    x, y, z = (max(along) - min(along) for along in zip(*points, strict=True))
    return x, y, z
