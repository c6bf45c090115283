"""Machine that is operated: joints, link lengths, limits and speeds.

A machine is a slewing base that carries a chain of pitch joints, written as a standard
Denavit-Hartenberg table. Angles are degrees in YAML, and radians everywhere else.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from pydantic import Field, PositiveFloat, ValidationInfo, model_validator

from labcrane.files.model import StrictModel, was_run
from labcrane.machines.meshes.mesh_file import Looks, MeshFile

FEWEST_JOINTS = 3

GRAVITY = 9.81
"""Free fall in every engine and for every weight, in m/s²."""

UPWARD_TO_LEVEL = -90.0
"""Twist in degrees from a slew axis to the pitch axes behind it."""


ROUNDING = 1e-9
"""Share of the largest moment of inertia that rounding may take from the sum of the others."""


def impossible(inertia: Sequence[float]) -> str:
    """Return why no body has these moments of inertia, xx, yy, zz, xy, xz and yz in kg m².

    Empty if one has.
    """
    import numpy as np  # noqa: PLC0415 - most protocols are checked without

    xx, yy, zz, xy, xz, yz = inertia
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least, middle, largest = moments.tolist()
    shown = f"the principal moments of inertia {least:.4g}, {middle:.4g} and {largest:.4g} kg m²"
    if least <= 0.0:
        return f"has {shown}; all must be above 0"
    if least + middle < largest * (1.0 - ROUNDING):
        return f"has {shown}; no body has one that is larger than the sum of the others"
    return ""


class Joint(StrictModel):
    """One joint and the link behind it, as a row of a standard DH table."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    """A lower-case word; names the joint's columns in a recording."""

    a: float = Field(default=0.0, ge=0.0)
    """Link length along the turned x axis, in metres."""

    d: float = 0.0
    """Link offset along the joint axis, in metres."""

    alpha_deg: float = 0.0
    """Twist to the next joint axis, in degrees."""

    offset_deg: float = 0.0
    """Added to the joint angle, in degrees: where the zero pose is."""

    range_deg: tuple[float, float]
    """Lowest and highest joint angle, in degrees."""

    speed_deg_s: PositiveFloat
    """Largest joint speed, in degrees per second."""

    rest_deg: float = 0.0
    """Joint angle at which a session begins, in degrees."""

    mass_kg: PositiveFloat
    """Mass of the link, in kilograms."""

    effort: PositiveFloat
    """Largest joint torque, in newton metres."""

    thickness: PositiveFloat = 0.3
    """Height and width of the link's beam, in metres."""

    mesh: Looks | None = None
    """Visual geometry instead of a beam, in the frame at the far end of the link: x along it."""

    centre_m: tuple[float, float, float] | None = None
    """Centre of mass, in metres, from the joint: x along the link, y along the pitch axis, z up.
    The middle of its beam by default."""

    inertia_kgm2: tuple[float, float, float, float, float, float] | None = None
    """Moments of inertia about the centre of mass in the same directions, in kg m²: xx, yy, zz, xy,
    xz, yz. Those of its beam by default."""

    @model_validator(mode="after")
    def _rest_is_within_range(self) -> "Joint":
        lowest, highest = self.range_deg
        if not lowest < highest:
            raise ValueError(
                f"range_deg must rise, but is {lowest} to {highest} degrees; write the lowest first"
            )
        if not lowest <= self.rest_deg <= highest:
            raise ValueError(
                f"rest_deg {self.rest_deg:g} is outside the joint's range; it must be "
                f"{lowest:g} to {highest:g}"
            )
        return self

    @model_validator(mode="after")
    def _a_body_has_its_inertia(self, info: ValidationInfo) -> "Joint":
        given = None if was_run(info) else self.inertia_kgm2
        if given is not None and (why := impossible(given)):
            raise ValueError(f"link {self.name!r} {why}; correct inertia_kgm2")
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest joint angle, in rad."""
        return math.radians(self.range_deg[0]), math.radians(self.range_deg[1])

    @property
    def speed(self) -> float:
        """Largest joint speed, in rad/s."""
        return math.radians(self.speed_deg_s)

    @property
    def alpha(self) -> float:
        """Twist to the next joint axis, in rad."""
        return math.radians(self.alpha_deg)

    @property
    def offset(self) -> float:
        """Offset that is added to the joint angle, in rad."""
        return math.radians(self.offset_deg)


class Machine(StrictModel):
    """A slewing base and a chain of pitch joints; positive pitch is down."""

    title: str
    """Description for people."""

    source: str
    """Where the figures come from."""

    base_x: float = 0.0
    """Distance of the slew axis in front of the base frame's origin, in metres."""

    base_mesh: Looks | None = None
    """Visual geometry of its foot instead of a plate, in the base frame."""

    joints: tuple[Joint, ...]
    """From the base outward, three or more; the first one slews."""

    @model_validator(mode="after")
    def _slews_then_pitches(self) -> "Machine":
        # A bound of the field would count only the joints that are right, and complain twice.
        if len(self.joints) < FEWEST_JOINTS:
            raise ValueError(
                f"a machine needs {FEWEST_JOINTS} joints or more, but has {len(self.joints)}"
            )
        slew, *pitch = self.joints
        names = [joint.name for joint in self.joints]
        if len(set(names)) < len(names):
            raise ValueError(f"joints are called {', '.join(names)}; give each a name of its own")
        if slew.alpha_deg != UPWARD_TO_LEVEL:
            raise ValueError("the first joint slews: it needs alpha_deg -90")
        for joint in pitch:
            if joint.alpha_deg != 0.0 or joint.d != 0.0:
                raise ValueError(f"joint {joint.name!r} pitches: it needs alpha_deg 0 and d 0")
        return self

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Joint names, from the base outward."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def speeds(self) -> tuple[float, ...]:
        """Largest joint speeds, in rad/s."""
        return tuple(joint.speed for joint in self.joints)

    @cached_property
    def limits(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest joint angles, in rad."""
        return tuple(joint.limits for joint in self.joints)

    @cached_property
    def rest(self) -> tuple[float, ...]:
        """Joint angles at which a session begins, in rad."""
        return tuple(math.radians(joint.rest_deg) for joint in self.joints)


@dataclass(frozen=True, slots=True)
class Body:
    """A box that moves with a joint, for renderers of the machine.

    Attributes
    ----------
    name
        Whose box it is.
    frame
        0 for the base frame, otherwise the DH frame behind joint number ``frame``.
    size, centre
        Edge lengths and centre in that frame, in metres, x, y, z.
    moves
        What it moves with instead of a joint: its frame is then the state's ``MOVES.position`` and
        ``MOVES.orientation``, a quaternion x, y, z, w.
    mesh
        Visual geometry instead of a box, in that frame.
    """

    name: str
    frame: int
    size: tuple[float, float, float]
    centre: tuple[float, float, float]
    moves: str = ""
    mesh: MeshFile | None = None
