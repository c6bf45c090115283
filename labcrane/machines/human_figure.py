"""A lying human figure of simple shapes, with limbs that can be set, drawn, or deformed."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from labcrane.files.model import StrictModel
from labcrane.machines.meshes.mesh_file import MeshFile

Point = tuple[float, float, float]
Extent = tuple[float, float]


class ShapeKind(StrEnum):
    """Shape of a part; capsules lie along x, and a hull is the solid around its points."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    CAPSULE = "capsule"
    HULL = "hull"


@dataclass(frozen=True, slots=True)
class Geom:
    """One shape of a thing.

    Attributes
    ----------
    name
        The body region, or the thing's own name.
    size
        Edge lengths in m; for a capsule its whole length, and twice its diameter; for a hull that
        of the box around it.
    centre, yaw
        In the thing's frame, in m and rad.
    mesh
        Its visual geometry, if it is another one.
    points
        Corners of a hull, about its centre, in m.
    drawn
        Whether it is drawn; not where the mesh of a shape before it, of the same name, shows it.
    """

    name: str
    shape: ShapeKind
    size: Point
    centre: Point
    yaw: float
    mesh: MeshFile | None = None
    points: tuple[Point, ...] = ()
    drawn: bool = True


LIMBS: dict[str, tuple[str | None, float, float, Point]] = {
    "left_upper_arm": (None, 0.30, 0.09, (-0.22, 0.24, 0.0)),
    "left_forearm": ("left_upper_arm", 0.26, 0.08, (0.0, 0.0, 0.0)),
    "right_upper_arm": (None, 0.30, 0.09, (-0.22, -0.24, 0.0)),
    "right_forearm": ("right_upper_arm", 0.26, 0.08, (0.0, 0.0, 0.0)),
    "left_thigh": (None, 0.42, 0.14, (0.52, 0.10, 0.0)),
    "left_shank": ("left_thigh", 0.42, 0.11, (0.0, 0.0, 0.0)),
    "right_thigh": (None, 0.42, 0.14, (0.52, -0.10, 0.0)),
    "right_shank": ("right_thigh", 0.42, 0.11, (0.0, 0.0, 0.0)),
}
"""For each limb: which one it hangs on, length and diameter in m, and where it begins. The figure's
x goes from the chest to the feet."""

TRUNK = (
    Geom("torso", ShapeKind.BOX, (0.55, 0.36, 0.22), (0.0, 0.0, 0.0), 0.0),
    Geom("head", ShapeKind.SPHERE, (0.20, 0.20, 0.20), (-0.46, 0.0, 0.0), 0.0),
    Geom("pelvis", ShapeKind.BOX, (0.22, 0.34, 0.20), (0.40, 0.0, 0.0), 0.0),
)

HEIGHT_M = 0.22
"""The thickest part, the chest."""

REGIONS = (*(part.name for part in TRUNK), *LIMBS)


class Deformity(StrictModel):
    """A limb that is bent where it should be straight."""

    limbs: tuple[str, ...] = Field(min_length=1)
    """One of these has it; which one is drawn from the trial's seed."""

    bend_deg: Extent = (20.0, 40.0)
    """By how much it is bent, in degrees; drawn evenly."""

    absent: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of trials in which no limb has it, drawn from the trial's seed: a report in one of them
    is a false alarm."""


class Figure(StrictModel):
    """A person of simple shapes, lying on the back."""

    position: Point
    """Where the chest is, in the machine's base frame, in metres."""

    yaw_deg: float | Extent = 0.0
    """Turned to the left, in degrees: at 0 the feet point away from the machine. A pair is
    drawn."""

    jointed: bool = False
    """Whether head, pelvis and limbs move in joints, with friction and limits; one rigid body
    otherwise."""

    mass_kg: PositiveFloat = 75.0
    """Mass of the whole, in kilograms."""

    friction: NonNegativeFloat = 0.5
    """Coefficient of friction, a share of the force that presses."""

    slip_n: PositiveFloat = 600.0
    """Force, in newtons, at which it slips out of the jaws."""

    limbs_deg: dict[str, float | Extent] = Field(default_factory=dict)
    """How far each limb is turned outward in its joint, in degrees; a pair is drawn evenly from the
    trial's seed; 0 is along the body."""

    deformity: Deformity | None = None
    """None by default."""

    limits_n: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Contact force, in newtons, beyond which touching a region is a mistake."""

    ground_n: dict[str, PositiveFloat] = Field(default_factory=dict)
    """Force, in newtons, beyond a region's own weight with which it may meet the ground or what
    carries it; more is a mistake. Half the weight of the whole by default. Of a jointed figure."""

    source: str = ""
    """Where the limits come from."""

    @model_validator(mode="after")
    def _names_are_known(self) -> "Figure":
        deformed = self.deformity.limbs if self.deformity else ()
        for name, known in (
            *((name, tuple(LIMBS)) for name in (*self.limbs_deg, *deformed)),
            *((name, REGIONS) for name in (*self.limits_n, *self.ground_n)),
        ):
            if name not in known:
                raise ValueError(f"a figure has no {name!r}; it has {', '.join(known)}")
        if self.position[2] < HEIGHT_M / 2:
            raise ValueError(
                f"the figure's chest is {self.position[2]} m high, which is in the ground; "
                f"{HEIGHT_M / 2} m or more"
            )
        return self


def figure_parts(
    figure: Figure, random: np.random.Generator
) -> tuple[tuple[Geom, ...], str | None, float]:
    """Return a figure's parts, its deformed limb if it has one, and its yaw in rad."""
    yaw = math.radians(_draw(figure.yaw_deg, random))
    turned = {name: math.radians(_draw(figure.limbs_deg.get(name, 0.0), random)) for name in LIMBS}
    bent, bend = None, 0.0
    if figure.deformity is not None:
        bent = str(random.choice(figure.deformity.limbs))
        bend = math.radians(random.uniform(*figure.deformity.bend_deg))
        absent = figure.deformity.absent
        if absent > 0.0 and random.random() < absent:
            bent = None
    parts = list(TRUNK)
    ends: dict[str, tuple[Point, float]] = {}
    for name, (parent, length, thick, start) in LIMBS.items():
        outward = 1.0 if name.startswith("left") else -1.0
        at, heading = ends[parent] if parent else (start, 0.0)
        heading += outward * turned[name]
        pieces = ((0.5, 0.0), (0.5, bend)) if name == bent else ((1.0, 0.0),)
        for share, more in pieces:
            heading += outward * more
            step = (share * length * math.cos(heading), share * length * math.sin(heading), 0.0)
            middle = (at[0] + step[0] / 2, at[1] + step[1] / 2, at[2])
            parts.append(
                Geom(name, ShapeKind.CAPSULE, (share * length, thick, thick), middle, heading)
            )
            at = (at[0] + step[0], at[1] + step[1], at[2])
        ends[name] = (at, heading)
    return tuple(parts), bent, yaw


def _draw(value: float | Extent, random: np.random.Generator) -> float:
    return float(random.uniform(*value)) if isinstance(value, tuple) else value
