"""A machine as URDF text, for engines.

URDF puts a link's frame at its near joint and DH at its far end; both put zero joint angles and
the signs of motion in the same place. All frames are x along the link, y along the pitch axis and
z up, so a pitch axis is +y (positive is down), and the DH offset turns the joint's origin.
"""

import locale
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

from labcrane.machines.machine import Joint, Machine

Vector = tuple[float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)


@contextmanager
def points_in_numbers() -> Iterator[None]:
    """Let an engine that reads numbers by the process's locale read points, not commas.

    Bullet reads a mass of 0.9 kg as 0 where a plugin has set a locale that writes 0,9. The locale
    is the whole process's for as long: only C offers one of a thread, and otherwise on each system.
    """
    before = locale.setlocale(locale.LC_NUMERIC)
    locale.setlocale(locale.LC_NUMERIC, "C")
    try:
        yield
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def urdf_of(machine: Machine, *, solid: bool = False, beyond: Iterable[str] = ()) -> str:
    """Return the URDF; link ``i`` hangs on joint ``i``, both with the DH joint's name.

    Numbers have all their digits.

    Parameters
    ----------
    solid
        Whether links are boxes that touch things; otherwise they have mass and inertia only, since
        shapes cost time.
    beyond
        Further links and joints, as of :func:`urdf_link` and :func:`urdf_joint`.
    """
    slew, *chain = machine.joints
    column = (slew.a + slew.thickness, slew.thickness, abs(slew.d) or slew.thickness)
    middle = (0.5 * slew.a, 0.0, 0.5 * slew.d)
    parts = [
        '<robot name="machine">',
        urdf_link("foot", 0.0, ORIGIN),
        _moved(slew, column, middle, solid=solid),
        _driven(slew, "foot", (machine.base_x, 0.0, 0.0), (0.0, 0.0, slew.offset), "0 0 1"),
    ]
    parent, far_end = slew, (slew.a, 0.0, slew.d)
    for joint in chain:
        beam = (joint.a or joint.thickness, joint.thickness, joint.thickness)
        middle = (0.5 * joint.a, 0.0, 0.0)
        parts.append(_moved(joint, beam, middle, solid=solid))
        parts.append(_driven(joint, parent.name, far_end, (0.0, joint.offset, 0.0), "0 1 0"))
        parent, far_end = joint, (joint.a, 0.0, 0.0)
    return "\n".join([*parts, *beyond, "</robot>"]) + "\n"


def _moved(joint: Joint, size: Vector, middle: Vector, *, solid: bool) -> str:
    """Return the link behind a joint: a box, with the inertia that the machine has."""
    mass, about, inertia = joint.mass_kg, joint.centre_m, joint.inertia_kgm2
    return urdf_link(joint.name, mass, size, middle, solid=solid, about=about, inertia=inertia)


def urdf_link(
    name: str,
    mass: float,
    size: Vector,
    centre: Vector = ORIGIN,
    *,
    solid: bool = False,
    about: Vector | None = None,
    inertia: Sequence[float] | None = None,
) -> str:
    """Return a link that is a box of a mass in kg, of a size in m, about its centre in m.

    Its centre of mass is ``about`` in m, and its moments of inertia in kg m² are ``inertia``: xx,
    yy, zz, xy, xz, yz; those of the box by default.
    """
    x, y, z = (edge * edge for edge in size)
    box = (mass / 12.0 * (y + z), mass / 12.0 * (x + z), mass / 12.0 * (x + y), 0.0, 0.0, 0.0)
    ixx, iyy, izz, ixy, ixz, iyz = inertia or box
    shape = (
        f'<collision>{_origin(centre)}<geometry><box size="{" ".join(map(repr, size))}"/>'
        "</geometry></collision>"
        if solid
        else ""
    )
    return (
        f'<link name="{name}"><inertial>{_origin(about or centre)}<mass value="{mass!r}"/>'
        f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="{ixy!r}" ixz="{ixz!r}" '
        f'iyz="{iyz!r}"/>'
        f"</inertial>{shape}</link>"
    )


def urdf_joint(
    name: str,
    parent: str,
    place: Vector,
    axis: str,
    limits: tuple[float, float],
    drive: tuple[float, float],
    turn: Vector = ORIGIN,
) -> str:
    """Return the joint of link ``name``, which has its name, on link ``parent``.

    Parameters
    ----------
    place, turn
        Where it is in the parent's frame, in m, and how its frame is turned, in rad.
    axis
        About which it turns: ``"0 1 0"``.
    limits
        Lowest and highest angle, in rad.
    drive
        Largest torque in N m, and largest speed in rad/s.
    """
    (lowest, highest), (effort, speed) = limits, drive
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/>'
        f'<child link="{name}"/>{_origin(place, turn)}<axis xyz="{axis}"/>'
        f'<limit lower="{lowest!r}" upper="{highest!r}" effort="{effort!r}" velocity="{speed!r}"/>'
        "</joint>"
    )


def _driven(joint: Joint, parent: str, place: Vector, turn: Vector, axis: str) -> str:
    drive = (joint.effort, joint.speed)
    return urdf_joint(joint.name, parent, place, axis, joint.limits, drive, turn)


def _origin(place: Vector, turn: Vector = ORIGIN) -> str:
    xyz, rpy = (" ".join(repr(number) for number in vector) for vector in (place, turn))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'
