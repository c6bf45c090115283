"""What the arm looks like: a box for its foot, one along every link, and one for each jaw."""

from labcrane import Body, Machine, ProtocolError
from labcrane_dmd.arm_settings import JawsSettings
from labcrane_dmd.urdf import BEYOND


def boxes(machine: Machine, jaws: JawsSettings | None) -> tuple[Body, ...]:
    """Return the boxes in DH frames, which sit at the far ends of links, x along the link.

    The jaws are drawn shut, in the frame of the link before them: each turns by half their angle
    about the hinge, which no DH frame does.
    """
    slew, *chain = machine.joints
    wide = slew.thickness
    found = [
        Body(
            "foot",
            0,
            (3.0 * wide, 3.0 * wide, 0.5 * wide),
            (0.0, 0.0, 0.25 * wide),
            mesh=machine.base_mesh,
        ),
        Body(
            slew.name,
            1,
            (wide, abs(slew.d) or wide, wide),
            (0.0, 0.5 * slew.d, 0.0),
            mesh=slew.mesh,
        ),
    ]
    for frame, joint in enumerate(chain[:-1] if jaws else chain, start=2):
        size = (joint.a or joint.thickness, joint.thickness, joint.thickness)
        found.append(Body(joint.name, frame, size, (-0.5 * joint.a, 0.0, 0.0), mesh=joint.mesh))
    if jaws and chain[-1].mesh is not None:
        raise ProtocolError(
            f"joint {chain[-1].name!r} has a mesh, but jaws are drawn as their settings say; leave "
            "mesh out"
        )
    if jaws:
        size = (BEYOND * jaws.length_m, jaws.thickness_m, jaws.width_m)
        middle = (BEYOND / 2 - 1.0) * jaws.length_m
        side = 0.5 * jaws.thickness_m
        before = len(machine.joints) - 1
        found.append(Body("jaw_upper", before, size, (middle, -side, 0.0)))
        found.append(Body("jaw_lower", before, size, (middle, side, 0.0)))
    return tuple(found)
