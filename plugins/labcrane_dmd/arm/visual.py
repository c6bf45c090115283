"""Visual shape of the arm: a box for its foot, one along every link, one for each jaw."""

from labcrane import Machine, ProtocolError
from labcrane.machines import Body, link_boxes
from labcrane_dmd.arm.settings import JawsSettings
from labcrane_dmd.arm.urdf import BEYOND


def boxes(machine: Machine, jaws: JawsSettings | None) -> tuple[Body, ...]:
    """Return the boxes in DH frames, which sit at the far ends of links, x along the link.

    The jaws are drawn shut, in the frame of the link before them: each turns by half their angle
    about the hinge, which no DH frame does.
    """
    found = list(link_boxes(machine))
    last = machine.joints[-1]
    if jaws and last.mesh is not None:
        raise ProtocolError(
            f"joint {last.name!r} has a mesh, but jaws are drawn as their settings say; leave "
            "mesh out"
        )
    if jaws:
        found.pop()  # the jaws are the last joint
        size = (BEYOND * jaws.length_m, jaws.thickness_m, jaws.width_m)
        middle = (BEYOND / 2 - 1.0) * jaws.length_m
        side = 0.5 * jaws.thickness_m
        before = len(machine.joints) - 1
        found.append(Body("jaw_upper", before, size, (middle, -side, 0.0)))
        found.append(Body("jaw_lower", before, size, (middle, side, 0.0)))
    return tuple(found)
