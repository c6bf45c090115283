"""A machine as URDF text, for engines.

URDF puts a link's frame at its near joint and DH at its far end; both put zero joint angles and
the signs of motion in the same place. All frames are x along the link, y along the pitch axis and
z up, so a pitch axis is +y (positive is down), and the DH offset turns the joint's origin.
"""

from collections.abc import Iterable

from labcrane.machines.machine import Joint, Machine

Vector = tuple[float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)


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
    column = (slew.thickness, slew.thickness, abs(slew.d) or slew.thickness)
    parts = [
        '<robot name="machine">',
        urdf_link("foot", 0.0, ORIGIN),
        urdf_link(slew.name, slew.mass_kg, column, (0.0, 0.0, 0.5 * slew.d), solid=solid),
        _driven(slew, "foot", (machine.base_x, 0.0, 0.0), (0.0, 0.0, slew.offset), "0 0 1"),
    ]
    parent, far_end = slew, (0.0, 0.0, slew.d)
    for joint in chain:
        beam = (joint.a or joint.thickness, joint.thickness, joint.thickness)
        middle = (0.5 * joint.a, 0.0, 0.0)
        parts.append(urdf_link(joint.name, joint.mass_kg, beam, middle, solid=solid))
        parts.append(_driven(joint, parent.name, far_end, (0.0, joint.offset, 0.0), "0 1 0"))
        parent, far_end = joint, (joint.a, 0.0, 0.0)
    return "\n".join([*parts, *beyond, "</robot>"]) + "\n"


def urdf_link(
    name: str, mass: float, size: Vector, centre: Vector = ORIGIN, *, solid: bool = False
) -> str:
    """Return a link that is a box of a mass in kg, of a size in m, about its centre in m."""
    x, y, z = (edge * edge for edge in size)
    ixx, iyy, izz = (mass / 12.0 * both for both in (y + z, x + z, x + y))
    shape = (
        f'<collision>{_origin(centre)}<geometry><box size="{" ".join(map(repr, size))}"/>'
        "</geometry></collision>"
        if solid
        else ""
    )
    return (
        f'<link name="{name}"><inertial>{_origin(centre)}<mass value="{mass!r}"/>'
        f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/>'
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
