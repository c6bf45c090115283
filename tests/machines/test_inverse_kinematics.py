"""Points that can be reached, and some that cannot."""

import math

import numpy as np
import pytest

from labcrane import Machine
from labcrane.machines import link_frames, load_machine, reach
from labcrane.machines.library import machine_names


@pytest.fixture(params=machine_names())
def machine(request: pytest.FixtureRequest) -> Machine:
    return load_machine(request.param)


def test_wherever_the_joints_can_put_the_tip_is_reached_within_their_limits(
    machine: Machine,
) -> None:
    lowest, highest = np.array(machine.limits).T
    for angles in np.random.default_rng(7).uniform(lowest, highest, (40, len(lowest))):
        point = link_frames(machine, angles.tolist())[-1, :3, 3]
        radius = math.hypot(point[0] - machine.base_x, point[1])
        bearing = math.atan2(point[1], point[0] - machine.base_x)
        if radius < 1.0 or not lowest[0] <= bearing - machine.joints[0].offset <= highest[0]:
            continue  # bent over backwards
        found = reach(machine, point.tolist())
        assert found is not None, point
        assert np.linalg.norm(link_frames(machine, found)[-1, :3, 3] - point) < 1e-3
        assert (np.array(found) >= lowest).all()
        assert (np.array(found) <= highest).all()


def test_beyond_the_links_nothing_is_reached(machine: Machine) -> None:
    length = sum(joint.a for joint in machine.joints)
    height = machine.joints[0].d
    assert reach(machine, (machine.base_x + length + 0.01, 0.0, height)) is None
    assert reach(machine, (machine.base_x, 0.0, height + length + 0.01)) is None
    assert reach(machine, (0.0, -2.0 * length, 0.0)) is None


def test_the_joints_limits_are_part_of_the_question(machine: Machine) -> None:
    ahead = (machine.base_x + 5.5, 0.0, 0.8)
    assert reach(machine, ahead) is not None
    stiff = [
        joint.model_copy(update={"range_deg": (joint.rest_deg, joint.rest_deg + 0.1)})
        for joint in machine.joints
    ]
    fields = {"title": machine.title, "source": machine.source, "base_x": machine.base_x}
    assert reach(Machine(**fields, joints=tuple(stiff)), ahead) is None
