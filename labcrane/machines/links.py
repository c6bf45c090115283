"""Links drawn without meshes: a box for the machine's foot and one along every link."""

from labcrane.machines.machine import Body, Machine


def link_boxes(machine: Machine) -> tuple[Body, ...]:
    """Return the boxes in DH frames, in metres; a link without length is a cube of its thickness.

    Frame ``i`` sits at the far end of link ``i``, x along the link. Behind the slew joint its y
    axis points down, so the column reaches from there to ``d`` along y.
    """
    slew, *chain = machine.joints
    wide = slew.thickness
    boxes = [
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
            (slew.a + wide, abs(slew.d) or wide, wide),
            (-0.5 * slew.a, 0.5 * slew.d, 0.0),
            mesh=slew.mesh,
        ),
    ]
    for frame, joint in enumerate(chain, start=2):
        size = (joint.a or joint.thickness, joint.thickness, joint.thickness)
        boxes.append(Body(joint.name, frame, size, (-0.5 * joint.a, 0.0, 0.0), mesh=joint.mesh))
    return tuple(boxes)
