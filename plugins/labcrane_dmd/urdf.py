"""The arm as URDF text: links with shapes, and two jaws that share one angle.

Frames are x along the link, y along the pitch axis and z up, so positive pitch is down, and the DH
offset turns the joint's origin. Nothing of the arm touches anything else of the arm.
"""

from labcrane import Joint, Machine
from labcrane_dmd.arm_settings import JawsSettings

Vector = tuple[float, float, float]

BEYOND = 1.25
"""Length of a jaw, in distances from its hinge to the point between the jaws."""


def urdf(machine: Machine, jaws: JawsSettings | None) -> str:
    """Return the URDF; with jaws, their joint becomes ``jaw_upper`` and ``jaw_lower``."""
    slew, *chain = machine.joints
    parts = ['<robot name="arm">', _link("foot", 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    column = (slew.thickness, slew.thickness, abs(slew.d) or slew.thickness)
    parts.append(_link(slew.name, slew.mass_kg, column, (0.0, 0.0, 0.5 * slew.d)))
    parts.append(_joint(slew, "foot", (machine.base_x, 0.0, 0.0), (0.0, 0.0, slew.offset), "0 0 1"))
    parent, far_end = slew.name, (0.0, 0.0, slew.d)
    for joint in chain[:-1] if jaws else chain:
        length = joint.a - (jaws.length_m if jaws and joint is chain[-2] else 0.0)
        beam = (length or joint.thickness, joint.thickness, joint.thickness)
        parts.append(_link(joint.name, joint.mass_kg, beam, (0.5 * length, 0.0, 0.0)))
        parts.append(_joint(joint, parent, far_end, (0.0, joint.offset, 0.0), "0 1 0"))
        parent, far_end = joint.name, (length, 0.0, 0.0)
    if jaws:
        parts.extend(_jaws(chain[-1], jaws, parent, far_end))
    parts.append("</robot>")
    return "\n".join(parts) + "\n"


def _jaws(joint: Joint, jaws: JawsSettings, parent: str, hinge: Vector) -> list[str]:
    length, thick = BEYOND * jaws.length_m, jaws.thickness_m
    lowest, highest = (0.5 * limit for limit in joint.limits)
    found = []
    for name, axis, side in (("jaw_upper", "0 -1 0", 0.5), ("jaw_lower", "0 1 0", -0.5)):
        size = (length, jaws.width_m, thick)
        found.append(_link(name, 0.5 * joint.mass_kg, size, (0.5 * length, 0.0, side * thick)))
        found.append(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}"/>'
            f'{_origin(hinge)}<axis xyz="{axis}"/><limit lower="{lowest!r}" upper="{highest!r}" '
            f'effort="{joint.effort!r}" velocity="{joint.speed!r}"/></joint>'
        )
    return found


def _link(name: str, mass: float, size: Vector, centre: Vector) -> str:
    x, y, z = (edge * edge for edge in size)
    ixx, iyy, izz = (mass / 12.0 * both for both in (y + z, x + z, x + y))
    shape = (
        f'<collision>{_origin(centre)}<geometry><box size="{" ".join(map(repr, size))}"/>'
        "</geometry></collision>"
        if mass
        else ""
    )
    return (
        f'<link name="{name}"><inertial>{_origin(centre)}<mass value="{mass!r}"/>'
        f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/>'
        f"</inertial>{shape}</link>"
    )


def _joint(joint: Joint, parent: str, place: Vector, turn: Vector, axis: str) -> str:
    lowest, highest = joint.limits
    return (
        f'<joint name="{joint.name}" type="revolute"><parent link="{parent}"/>'
        f'<child link="{joint.name}"/>{_origin(place, turn)}<axis xyz="{axis}"/>'
        f'<limit lower="{lowest!r}" upper="{highest!r}" '
        f'effort="{joint.effort!r}" velocity="{joint.speed!r}"/></joint>'
    )


def _origin(place: Vector, turn: Vector = (0.0, 0.0, 0.0)) -> str:
    xyz, rpy = (" ".join(repr(number) for number in vector) for vector in (place, turn))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'
