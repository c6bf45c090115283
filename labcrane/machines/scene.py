"""Scenes: objects, obstacles and a human figure around a machine, from a YAML file.

The machine that touches a scene and the task that judges it read the same file, and place what is
drawn from a seed in the same way.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PrivateAttr, model_validator

from labcrane.errors import ProtocolError
from labcrane.files.model import StrictModel
from labcrane.files.yaml import YamlFile
from labcrane.machines.human_figure import REGIONS, Figure, Geom, ShapeKind, figure_parts
from labcrane.machines.machine import GRAVITY
from labcrane.machines.meshes.mesh_file import Looks
from labcrane.machines.scene_part import Part, PartFile, load_part, lowest

Point = tuple[float, float, float]
Extent = tuple[float, float]

__all__ = [
    "Geom",
    "Goal",
    "PlacedObject",
    "Scene",
    "SceneObject",
    "ShapeKind",
    "load_scene",
    "place_objects",
]

SUNK_M = 0.001
"""Depth in the ground, in metres, from which on a scene is impossible."""


class Scatter(StrictModel):
    """Largest distance of a thing from its place; sampled uniformly from the trial's seed."""

    x: Extent = (0.0, 0.0)
    """Metres ahead."""

    y: Extent = (0.0, 0.0)
    """Metres to the left."""

    yaw_deg: Extent = (0.0, 0.0)
    """Degrees, turned to the left."""


class SceneObject(StrictModel):
    """An object, or an obstacle when it is fixed: one shape, or a part of a library."""

    use: PartFile | None = None
    """File of a library part, from the scene's folder; it has all but place, turn and scatter."""

    shape: Literal["box", "cylinder", "sphere"] | None = None
    """A cylinder stands upright; needed unless a part is used."""

    size: Point | None = None
    """Edge lengths in metres; a cylinder's and a sphere's first is the diameter, a cylinder's last
    the height; needed unless a part is used."""

    position: Point
    """Where its centre is, or the origin of the part that is used, in the machine's base frame, in
    metres."""

    yaw_deg: float = 0.0
    """Turned to the left, in degrees."""

    fixed: bool = False
    """Whether it is an obstacle, which nothing moves."""

    mass_kg: PositiveFloat = 1.0
    """Its mass, in kilograms."""

    friction: NonNegativeFloat = 0.6
    """Coefficient of friction, a share of the force that presses."""

    limit_n: PositiveFloat | None = None
    """Contact force, in newtons, beyond which touching it is a mistake; none by default."""

    slip_n: PositiveFloat = 400.0
    """Force, in newtons, at which it slips out of the jaws."""

    scatter: Scatter = Scatter()
    """Where it may stand instead."""

    mesh: Looks | None = None
    """Visual geometry instead of its shape, in a frame at its centre; contact uses the shape."""

    _part: Part | None = PrivateAttr(default=None)

    @property
    def part(self) -> Part | None:
        """The part that is used, once :meth:`read_part` has read it."""
        return self._part

    def read_part(self) -> None:
        """Read the file of the part that is used: once, as things are placed while a session runs.

        Raises
        ------
        ProtocolError
            It cannot be read, or is not a part.
        """
        if self.use is not None:
            self._part = load_part(self.use)

    @model_validator(mode="after")
    def _is_one_or_the_other(self) -> "SceneObject":
        if self.use is None and (self.shape is None or self.size is None):
            raise ValueError("a thing has shape and size, or uses a part (use: parts/car.yaml)")
        beside = sorted(self.model_fields_set - {"use", "position", "yaw_deg", "scatter"})
        if self.use is not None and beside:
            raise ValueError(
                f"a thing that uses a part has {', '.join(beside)} from there; leave it out here, "
                "or write another part"
            )
        return self


class Goal(StrictModel):
    """A region in which something must come to be, and the way there.

    Each is reached in its turn.
    """

    position: Point
    """Centre of the region, in metres."""

    radius: PositiveFloat
    """In metres."""

    what: str = "tip"
    """What must come there: ``tip``, the name of an object or of the figure, or a part of a jointed
    figure: ``figure.pelvis``."""

    jaws: float | None = None
    """How far the jaws are then to be opened, from 0 to 1; whatever they are by default."""

    beside: str | None = None
    """Thing with which the region moves: its position counts from where that thing was placed."""

    hold_s: NonNegativeFloat = 0.2
    """How long it must stay there, in seconds."""

    touch: str | None = None
    """Thing, or the figure, that must be touched from there: it feels a force, and from then on,
    for ``hold_s``, none beyond its limits. Who pressed harder touches again."""

    grip: bool | None = None
    """Whether something must be in the grip (true), or nothing may be (false), to be there."""


class Scene(StrictModel):
    """Everything around the machine, and the goals with it."""

    labcrane_scene: Literal[1]
    """Version of the format."""

    title: str
    """Description for people."""

    things: dict[str, SceneObject] = Field(default_factory=dict)
    """Objects and obstacles by name."""

    figure: Figure | None = None
    """A lying person."""

    goals: tuple[Goal, ...] = Field(min_length=1)
    """Goals to be reached, in order; the last one ends the run."""

    start_deg: tuple[float, ...] | None = None
    """Joint angles at the start, in degrees; those of the machine at rest, by default."""

    limit_s: PositiveFloat = 600.0
    """Time after which the run ends, in seconds."""


@dataclass(frozen=True, slots=True)
class PlacedObject:
    """A thing at its place in one trial.

    Attributes
    ----------
    name, kind
        ``object``, ``obstacle`` or ``body``, which is the figure.
    parts
        Its shapes, in its own frame.
    position, yaw
        In metres and rad.
    mass, friction, slip
        In kg, 1, N.
    limits
        Largest force in N by part; the force on other parts is not limited.
    ground
        Largest force in N, beyond its own weight, between a part of an articulated figure and the
        ground under it; by part.
    deformed
        The part that is deformed, if any.
    jointed
        Whether parts of other names than the first move in joints.
    carries
        Whether what lies on it is carried by it, and does not hit it.
    """

    name: str
    kind: str
    parts: tuple[Geom, ...]
    position: Point
    yaw: float
    mass: float
    friction: float
    slip: float
    limits: dict[str, float]
    ground: dict[str, float] = field(default_factory=dict)
    deformed: str | None = None
    jointed: bool = False
    carries: bool = False


def load_scene(path: Path) -> Scene:
    """Read a scene.

    Raises
    ------
    ProtocolError
        With one line for every mistake.
    """
    source = YamlFile.read(path)
    if not isinstance(source.data, dict):
        raise ProtocolError(
            f"{path}:1:1: a scene is a mapping of keys, beginning with labcrane_scene: 1"
        )
    scene = source.checked(Scene)
    _check_parts(scene, source)
    source.raise_problems()
    _check_ground(scene, source)
    _check_goals(scene, source)
    source.raise_problems()
    return scene


def _check_parts(scene: Scene, source: YamlFile) -> None:
    """Read the library parts, and note those that cannot be."""
    for name, thing in scene.things.items():
        try:
            thing.read_part()
        except ProtocolError as error:
            source.problem(("things", name, "use"), f"{name!r} cannot be used: {error}")


def _check_ground(scene: Scene, source: YamlFile) -> None:
    """Note things that are in the ground."""
    for name, thing in scene.things.items():
        below = max(map(lowest, _parts(name, thing)))
        low = thing.position[2] - below
        if low < -SUNK_M:
            middle = "its centre" if thing.use is None else "its origin"
            source.problem(
                ("things", name, "position"),
                f"{name!r} is {-low:.3f} m deep in the ground; {middle} must be "
                f"{below:.3f} m high or more",
            )


def _check_goals(scene: Scene, source: YamlFile) -> None:
    """Note goals for what is not in the scene."""
    known = {"tip", *scene.things, *(("figure",) if scene.figure else ())}
    if scene.figure is not None and scene.figure.jointed:
        known |= {f"figure.{region}" for region in REGIONS if region != REGIONS[0]}
    for number, goal in enumerate(scene.goals):
        asked = {"what": goal.what, "beside": goal.beside or "tip", "touch": goal.touch or "tip"}
        for key, word in asked.items():
            if word not in known:
                there = ", ".join(sorted(known))
                source.problem(
                    ("goals", number, key), f"there is no {word!r} in this scene; there is {there}"
                )


def place_objects(scene: Scene, seed: int) -> tuple[PlacedObject, ...]:
    """Return the positions of all objects in a trial; they depend on this seed alone."""
    random = np.random.default_rng([seed, 0x5CE])
    placed = [_placed(name, thing, random) for name, thing in scene.things.items()]
    if scene.figure is not None:
        parts, deformed, yaw = figure_parts(scene.figure, random)
        placed.append(
            PlacedObject(
                name="figure",
                kind="body",
                parts=parts,
                position=scene.figure.position,
                yaw=yaw,
                mass=scene.figure.mass_kg,
                friction=scene.figure.friction,
                slip=scene.figure.slip_n,
                limits=dict(scene.figure.limits_n),
                ground=_ground(scene.figure),
                deformed=deformed,
                jointed=scene.figure.jointed,
            )
        )
    return tuple(placed)


def _placed(name: str, thing: SceneObject, random: np.random.Generator) -> PlacedObject:
    x, y, z = thing.position
    scatter = thing.scatter
    said = thing.part or thing
    return PlacedObject(
        name=name,
        kind="obstacle" if said.fixed else "object",
        parts=_parts(name, thing),
        position=(x + random.uniform(*scatter.x), y + random.uniform(*scatter.y), z),
        yaw=math.radians(thing.yaw_deg + random.uniform(*scatter.yaw_deg)),
        mass=said.mass_kg,
        friction=said.friction,
        slip=said.slip_n,
        limits=_limits(name, said),
        carries=isinstance(said, Part) and said.carries,
    )


def _ground(figure: Figure) -> dict[str, float]:
    """Return with how much each region may meet the ground; of one rigid body nothing is known."""
    half = 0.5 * figure.mass_kg * GRAVITY
    return {name: figure.ground_n.get(name, half) for name in REGIONS} if figure.jointed else {}


def _limits(name: str, said: SceneObject | Part) -> dict[str, float]:
    if isinstance(said, Part):
        return said.limits()
    return {} if said.limit_n is None else {name: said.limit_n}


def _parts(name: str, thing: SceneObject) -> tuple[Geom, ...]:
    if thing.part is not None:
        return thing.part.geoms()
    if thing.shape is None or thing.size is None:
        raise AssertionError("a thing has shape and size or a part that was read, or was refused")
    return (Geom(name, ShapeKind(thing.shape), thing.size, (0.0, 0.0, 0.0), 0.0, thing.mesh),)
