"""A machine as URDF text, for engines.

URDF puts a link's frame at its near joint and DH at its far end; both put zero joint angles and
the signs of motion in the same place. All frames are x along the link, y along the pitch axis and
z up, so a pitch axis is +y (positive is down), and the DH offset turns the joint's origin.
"""

from labcrane import Joint, Machine

Vector = tuple[float, float, float]


def urdf(machine: Machine) -> str:
    """Return the URDF; link ``i`` hangs on joint ``i``, both with the DH joint's name.

    Links have mass and inertia but no shape: the crane has nothing to touch yet, and shapes would
    only cost time. Numbers have all their digits.
    """
    slew, *chain = machine.joints
    parts = ['<robot name="crane">', _link("foot", 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    column = (slew.thickness, slew.thickness, abs(slew.d) or slew.thickness)
    parts.append(_link(slew.name, slew.mass_kg, column, (0.0, 0.0, 0.5 * slew.d)))
    parts.append(_joint(slew, "foot", (machine.base_x, 0.0, 0.0), (0.0, 0.0, slew.offset), "0 0 1"))
    parent, far_end = slew, (0.0, 0.0, slew.d)
    for joint in chain:
        beam = (joint.a or joint.thickness, joint.thickness, joint.thickness)
        parts.append(_link(joint.name, joint.mass_kg, beam, (0.5 * joint.a, 0.0, 0.0)))
        parts.append(_joint(joint, parent.name, far_end, (0.0, joint.offset, 0.0), "0 1 0"))
        parent, far_end = joint, (joint.a, 0.0, 0.0)
    parts.append("</robot>")
    return "\n".join(parts) + "\n"


def _link(name: str, mass: float, size: Vector, centre: Vector) -> str:
    x, y, z = (edge * edge for edge in size)
    ixx, iyy, izz = (mass / 12.0 * both for both in (y + z, x + z, x + y))
    return (
        f'<link name="{name}"><inertial>{_origin(centre)}<mass value="{mass!r}"/>'
        f'<inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
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
