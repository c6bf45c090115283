"""The arm as URDF text: links with shapes, and two jaws that share one angle.

Nothing of the arm touches anything else of the arm.
"""

from labcrane import Machine
from labcrane.machines import Joint, urdf_joint, urdf_link
from labcrane.machines import urdf_of as machine_urdf
from labcrane_dmd.arm.settings import JawsSettings

JAWS = ("jaw_upper", "jaw_lower")

BEYOND = 1.25
"""Length of a jaw, in distances from its hinge to the point between the jaws."""


def urdf_of(machine: Machine, jaws: JawsSettings | None) -> str:
    """Return the URDF; with jaws, their joint becomes ``jaw_upper`` and ``jaw_lower``."""
    if jaws is None:
        return machine_urdf(machine, solid=True)
    *inner, last, grip = machine.joints
    short = last.model_copy(update={"a": last.a - jaws.length_m})
    arm = machine.model_copy(update={"joints": (*inner, short)})
    return machine_urdf(arm, solid=True, beyond=_jaws(grip, jaws, short))


def link_names(machine: Machine, jaws: JawsSettings | None) -> tuple[str, ...]:
    """Return the names of the links that can touch things, in the engine's order."""
    return machine.names if jaws is None else (*machine.names[:-1], *JAWS)


def _jaws(joint: Joint, jaws: JawsSettings, parent: Joint) -> list[str]:
    length, thick = BEYOND * jaws.length_m, jaws.thickness_m
    lowest, highest = (0.5 * limit for limit in joint.limits)
    hinge, drive = (parent.a, 0.0, 0.0), (joint.effort, joint.speed)
    found = []
    for name, axis, side in zip(JAWS, ("0 -1 0", "0 1 0"), (0.5, -0.5), strict=True):
        size, centre = (length, jaws.width_m, thick), (0.5 * length, 0.0, side * thick)
        found.append(urdf_link(name, 0.5 * joint.mass_kg, size, centre, solid=True))
        found.append(urdf_joint(name, parent.name, hinge, axis, (lowest, highest), drive))
    return found
