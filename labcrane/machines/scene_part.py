"""Library parts: things of several shapes, each in a file of its own that scenes use."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PrivateAttr,
    ValidationInfo,
    model_validator,
)

from labcrane.files.model import StrictModel
from labcrane.files.yaml import YamlFile
from labcrane.machines.human_figure import Geom, Point, ShapeKind
from labcrane.machines.meshes.mesh_file import Looks, MeshFile

FEWEST = 4
"""Points that a solid has at least."""


class PartShape(StrictModel):
    """One shape of a library part."""

    shape: Literal["box", "cylinder", "sphere", "hull", "mesh"]
    """A cylinder stands upright; a hull is the smallest solid without hollows around its points; a
    mesh is touched as it is seen: it is made of solids that may stand in each other, each closed
    and without hollows, and so may have hollows itself."""

    size: Point = (0.0, 0.0, 0.0)
    """Edge lengths in metres; a cylinder's and a sphere's first is the diameter, a cylinder's last
    the height. A hull and a mesh have none."""

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
    """What it looks like instead, in a frame at its centre; its touch is the same. Of a mesh that
    is touched an OBJ file, which stands in the record as text: from there it is replayed."""

    _solids: tuple[tuple[Point, ...], ...] = PrivateAttr(default=())

    @model_validator(mode="after")
    def _has_an_extent(self) -> "PartShape":
        if self.shape == "mesh":
            self._read_solids()
        elif self.shape == "hull":
            if len(self.points) < FEWEST or any(self.size):
                raise ValueError(f"a hull has {FEWEST} points or more, and no size")
        elif self.points or min(self.size) <= 0.0:
            raise ValueError(f"a {self.shape} has a size of three lengths, and no points")
        return self

    def _read_solids(self) -> None:
        """Read the mesh once: things are placed while a session runs."""
        # What is read with needs SciPy, which a scene without meshes does without.
        from labcrane.machines.meshes.solids import read_solids  # noqa: PLC0415

        if self.mesh is None or self.points or any(self.size):
            raise ValueError("a mesh for contact has its file under mesh, and no size or points")
        if self.mesh.file.suffix.lower() != ".obj":
            raise ValueError(
                f"{self.mesh.file.name!r} is not an OBJ file; a mesh for contact must be one, "
                "because every recording contains it as text"
            )
        self._solids = tuple(
            tuple((float(x), float(y), float(z)) for x, y, z in corners)
            for corners in read_solids(self.mesh)
        )

    def geoms(self, name: str) -> tuple[Geom, ...]:
        """Return its solids, all of one name: a force on any of them is one on it."""
        yaw = math.radians(self.yaw_deg)
        if self.shape != "mesh":
            size = _extent(self.points) if self.points else self.size
            kind = ShapeKind(self.shape)
            return (Geom(name, kind, size, self.centre, yaw, self.mesh, self.points),)
        found = [self._solid(name, points, yaw) for points in self._solids]
        for at, geom in enumerate(found):  # the first shows them all
            found[at] = replace(
                geom, mesh=self._seen_from(geom) if at == 0 else None, drawn=at == 0
            )
        return tuple(found)

    def _solid(self, name: str, points: tuple[Point, ...], yaw: float) -> Geom:
        """Return one of its solids about the middle of the box around it."""
        middle = [(max(along) + min(along)) / 2.0 for along in zip(*points, strict=True)]
        own = tuple((x - middle[0], y - middle[1], z - middle[2]) for x, y, z in points)
        cos, sin = math.cos(yaw), math.sin(yaw)
        (x, y, z), (ahead, left, up) = self.centre, middle
        centre = (x + cos * ahead - sin * left, y + sin * ahead + cos * left, z + up)
        return Geom(name, ShapeKind.HULL, _extent(own), centre, yaw, None, own)

    def _seen_from(self, first: Geom) -> MeshFile | None:
        """Return its mesh in the frame of its first solid."""
        if self.mesh is None:
            return None
        cos, sin = math.cos(first.yaw), math.sin(first.yaw)
        x, y, z = (at - mine for at, mine in zip(self.centre, first.centre, strict=True))
        away = (cos * x + sin * y, -sin * x + cos * y, z)
        position = tuple(a + b for a, b in zip(self.mesh.position, away, strict=True))
        return self.mesh.model_copy(update={"position": position})


class Part(StrictModel):
    """A thing of a library: what it is of, and how it may be touched."""

    labcrane_part: Literal[1]
    """Version of the format."""

    title: str
    """Description for people."""

    shapes: dict[str, PartShape] = Field(min_length=1)
    """By name; forces are recorded, and limits hold, for each."""

    fixed: bool = False
    """Whether it is an obstacle, which nothing moves."""

    carries: bool = False
    """Whether a figure may lie on it: resting on it is not counted as a hit."""

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
        return tuple(geom for name, each in self.shapes.items() for geom in each.geoms(name))

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
