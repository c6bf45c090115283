"""Kinematics against the crane study's figures and against independent products."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from labcrane import FloatArray, Machine
from labcrane.machines import Arm, jacobian, link_frames, load_machine, rotation_matrix
from labcrane.machines.kinematics import dh_matrix

MACHINES = ("ch8", "ch8_cranelike")
SCALE = 22.3107  # from the OpenManipulator-X to the crane
ELBOW_TILT = math.atan2(0.128, 0.024)

OMX = {
    "title": "OpenManipulator-X",
    "source": "its public URDF",
    "base_x": 0.012,
    "joints": [
        {"name": "one", "d": 0.0765, "alpha_deg": -90, "range_deg": (-162, 162)},
        {"name": "two", "a": math.hypot(0.024, 0.128), "offset_deg": -math.degrees(ELBOW_TILT)},
        {"name": "three", "a": 0.124, "offset_deg": math.degrees(ELBOW_TILT)},
        {"name": "four", "a": 0.126},
    ],
}
REST = {"range_deg": (-90, 90), "speed_deg_s": 275, "mass_kg": 0.1, "effort": 1}


def omx() -> Machine:
    return Machine.model_validate({**OMX, "joints": [{**REST, **row} for row in OMX["joints"]]})


def turned(axis: str, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    if axis == "z":
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def omx_tip(angles: FloatArray) -> FloatArray:
    """Return the tip in m as the arm's URDF chains it: no DH in it."""
    place, facing = np.array([0.012, 0.0, 0.017]), np.eye(3)
    for axis, angle, offset in zip(
        "zyyy",
        angles,
        ([0.0, 0.0, 0.0595], [0.024, 0.0, 0.128], [0.124, 0.0, 0.0], [0.126, 0.0, 0.0]),
        strict=True,
    ):
        facing = facing @ turned(axis, angle)
        place = place + facing @ offset
    return place


def poses(machine: Machine, count: int = 1000, seed: int = 1) -> FloatArray:
    lowest, highest = np.array(machine.limits).T
    return np.random.default_rng(seed).uniform(lowest, highest, (count, len(lowest)))


@pytest.mark.parametrize("name", MACHINES)
def test_scalar_and_matrix_tips_agree(name: str) -> None:
    machine = load_machine(name)
    arm = Arm(machine)
    for pose in poses(machine).tolist():
        np.testing.assert_allclose(arm.tip(pose), link_frames(machine, pose)[-1, :3, 3], atol=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_the_jacobian_is_the_slope_of_the_tip(name: str) -> None:
    machine = load_machine(name)
    arm, small = Arm(machine), 1e-6
    for pose in poses(machine, 100):
        slope = np.column_stack(
            [
                np.subtract(arm.tip(pose + small * axis), arm.tip(pose - small * axis))
                for axis in np.eye(len(pose))
            ]
        ) / (2 * small)
        np.testing.assert_allclose(jacobian(machine, pose.tolist()), slope, atol=1e-8)


@pytest.mark.parametrize("name", MACHINES)
def test_the_planar_jacobian_is_the_whole_one_seen_along_the_arm(name: str) -> None:
    machine = load_machine(name)
    arm = Arm(machine)
    for pose in poses(machine, 200).tolist():
        bearing = arm.bearing(pose)
        outward = np.array([math.cos(bearing), math.sin(bearing), 0.0])
        whole = jacobian(machine, pose)
        planar = np.array(arm.planar_jacobian(pose)).T
        np.testing.assert_allclose(planar[0], outward @ whole[:, 1:], atol=1e-12)
        np.testing.assert_allclose(planar[1], whole[2, 1:], atol=1e-12)
        radius, height = arm.plane(pose)
        sideways = np.array([-outward[1], outward[0], 0.0])
        np.testing.assert_allclose(whole[:, 0], radius * sideways, atol=1e-12)
        assert height == pytest.approx(link_frames(machine, pose)[-1, 2, 3], abs=1e-12)


def test_dh_and_urdf_products_of_the_open_manipulator_agree() -> None:
    machine = omx()
    for pose in poses(machine):
        tip = link_frames(machine, pose.tolist())[-1, :3, 3]
        np.testing.assert_allclose(tip, omx_tip(pose), atol=1e-15)


def test_ch8_is_the_open_manipulator_scaled() -> None:
    machine = load_machine("ch8")
    # Five lengths are rounded to 0.1 mm, so the tip is at most 0.25 mm off, and 0.05 for base_x.
    for pose in poses(machine):
        np.testing.assert_allclose(
            Arm(machine).tip(pose.tolist()), SCALE * omx_tip(pose), atol=3e-4
        )


@pytest.mark.parametrize(("name", "ahead"), [("ch8", 0.2677 + 8.4832), ("ch8_cranelike", 8.49)])
def test_an_arm_stretched_level_reaches_as_far_as_its_links(name: str, ahead: float) -> None:
    machine = load_machine(name)
    level = [0.0, -machine.joints[1].offset, -machine.joints[2].offset, 0.0]
    height = machine.joints[0].d
    np.testing.assert_allclose(Arm(machine).tip(level), (ahead, 0.0, height), atol=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_positive_pitch_is_down_and_positive_slew_is_left(name: str) -> None:
    machine = load_machine(name)
    level = [0.0, -machine.joints[1].offset, -machine.joints[2].offset, 0.0]
    slopes = jacobian(machine, level)
    assert slopes[1, 0] > 0.0
    assert (slopes[2, 1:] < 0.0).all()


def test_the_shoulder_of_ch8_stands_where_the_study_puts_it() -> None:
    elbow = link_frames(load_machine("ch8"), [0.0] * 4)[2, :3, 3]
    np.testing.assert_allclose(elbow, (0.2677 + 0.5355, 0.0, 1.7068 + 2.8558), atol=1e-4)


def test_the_dh_matrix_turns_and_the_printed_one_does_not() -> None:
    for theta, alpha, determinant, defect in (
        (0.7, 0.4, 1.086, 0.315),
        (0.7, math.pi / 2, 0.585, 0.493),
    ):
        ours = dh_matrix(1.0, alpha, 2.0, theta)[:3, :3]
        np.testing.assert_allclose(ours @ ours.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(ours) == pytest.approx(1.0, abs=1e-15)
        printed = ours.copy()
        printed[0, 2] = math.sin(theta) * math.cos(alpha)
        assert np.linalg.det(printed) == pytest.approx(determinant, abs=5e-4)
        assert np.abs(printed @ printed.T - np.eye(3)).max() == pytest.approx(defect, abs=5e-4)


def test_the_dh_matrix_moves_by_the_link_and_the_printed_one_by_the_twist() -> None:
    link, alpha, offset, theta = 2.9, 0.4, 1.7, 0.7
    # Turn about z, slide along z, slide along the new x, twist about it: what DH means.
    slide = turned("z", theta) @ [link, 0.0, 0.0] + [0.0, 0.0, offset]
    ours = dh_matrix(link, alpha, offset, theta)[:3, 3]
    np.testing.assert_allclose(ours, slide, atol=1e-15)
    printed = [alpha * math.cos(theta), alpha * math.sin(theta), offset]
    assert np.abs(printed - slide).max() > 1.0


def test_a_quaternion_turns_as_scipy_says() -> None:
    for turn in Rotation.from_quat(np.random.default_rng(3).normal(size=(50, 4))):
        assert rotation_matrix(turn.as_quat()) == pytest.approx(turn.as_matrix(), abs=1e-12)
