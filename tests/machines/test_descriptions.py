"""Machines of URDF files move as the engines that read the files say."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from needs import needs

from labcrane import Machine, ProtocolError
from labcrane.core.cranes.crane_state import CraneState
from labcrane.machines import Arm, link_frames, reach, urdf_of
from labcrane.machines.descriptions.description import MachineDescription

EXAMPLES = Path(__file__).parents[2] / "examples" / "machines"
OMX = {
    "urdf": "openmanipulator_x.urdf",
    "joints": {"slew": "joint1", "shoulder": "joint2", "elbow": "joint3", "wrist": "joint4"},
    "tip": "gripper",
}
EXCAVATOR = {
    "urdf": "excavator.urdf",
    "joints": ["swing", "boom", "stick", "bucket"],
    "tip": "teeth",
}


def described(fields: dict[str, object], folder: Path = EXAMPLES) -> Machine:
    return MachineDescription.model_validate(fields).read(folder)[0]


def poses(machine: Machine, count: int = 300) -> np.ndarray:
    lowest, highest = np.array(machine.limits).T
    return np.random.default_rng(7).uniform(lowest, highest, (count, len(lowest)))


def random_urdf(seed: int) -> tuple[str, dict[str, float], list[str]]:
    """Return a URDF of a slewing base with pitch joints, with frames turned anyhow.

    Also the signs in which its joints count against labcrane's, and their names.
    """
    random = np.random.default_rng(seed)
    names = [f"J{number}" for number in range(int(random.integers(3, 7)))]
    facing = random.uniform(-math.pi, math.pi)
    parts, signs = ['<robot name="any"><link name="base"/>'], {}
    parent, frame, at = "base", np.eye(3), np.zeros(3)
    ahead = np.array([math.cos(facing), math.sin(facing), 0.0])
    across = np.cross([0.0, 0.0, 1.0], ahead)
    point = np.array([random.uniform(-1, 1), 0.0, random.uniform(0, 1)])
    for number, name in enumerate(names):
        direction = np.array([0.0, 0.0, 1.0]) if number == 0 else across
        sign = float(random.choice([-1.0, 1.0]))
        signs[name] = sign
        rpy = random.uniform(-math.pi, math.pi, 3)
        turn = turned(*rpy)
        # The frame on the axis may lie anywhere along it.
        origin = point + direction * random.uniform(-0.5, 0.5)
        xyz = frame.T @ (origin - at)
        now = frame @ turn
        axis = now.T @ (sign * direction)
        mass, com = random.uniform(1, 50), random.uniform(-0.5, 0.5, 3)
        parts.append(
            f'<link name="L{number}"><inertial><origin xyz="{row(com)}"/><mass value="{mass!r}"/>'
            f'<inertia ixx="2" iyy="3" izz="4" ixy="0.1" ixz="0.2" iyz="0.3"/></inertial></link>'
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="L{number}"/><origin xyz="{row(xyz)}" rpy="{row(rpy)}"/>'
            f'<axis xyz="{row(axis)}"/>'
            '<limit lower="-1.1" upper="1.3" effort="100" velocity="0.5"/></joint>'
        )
        parent, frame, at = f"L{number}", now, origin
        out = random.uniform(0.0, 0.5) if number == 0 else random.uniform(-1.5, 2)
        point = point + out * ahead + np.array([0.0, 0.0, random.uniform(-1, 1)])
    tip = frame.T @ (point - at)
    parts.append(
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="{parent}"/>'
        f'<child link="tip"/><origin xyz="{row(tip)}"/></joint></robot>'
    )
    return "".join(parts), signs, names


def turned(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return roll, pitch and yaw about fixed axes as a matrix."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def row(vector: np.ndarray) -> str:
    return " ".join(repr(float(number)) for number in vector)


def signs_of(machine: Machine, limits: tuple[float, float]) -> np.ndarray:
    """Return 1 where a joint counts as its file does, -1 where the other way round."""
    return np.array([1.0 if np.allclose(each, limits) else -1.0 for each in machine.limits])


def test_the_openmanipulator_is_the_one_whose_figures_the_crane_has() -> None:
    machine = described(OMX)
    assert [joint.a for joint in machine.joints] == pytest.approx(
        [0.0, math.hypot(0.024, 0.128), 0.124, 0.126]
    )
    assert machine.joints[1].offset_deg == pytest.approx(-math.degrees(math.atan2(0.128, 0.024)))
    assert machine.names == ("slew", "shoulder", "elbow", "wrist")
    assert machine.joints[3].mass_kg == pytest.approx(0.16)  # with the gripper that is fixed to it


@pytest.mark.parametrize("seed", range(20, 26))
def test_any_urdf_moves_as_an_independent_library_moves_it(seed: int, tmp_path: Path) -> None:
    import yourdfpy

    text, _, names = random_urdf(seed)
    (tmp_path / "any.urdf").write_text(text)
    called = {f"j{number}": name for number, name in enumerate(names)}
    machine = described({"urdf": "any.urdf", "joints": called, "tip": "tip"}, tmp_path)
    signs = signs_of(machine, (-1.1, 1.3))
    robot = yourdfpy.URDF.load(tmp_path / "any.urdf", load_meshes=False, build_scene_graph=True)
    for angles in poses(machine, 40):
        robot.update_cfg(dict(zip(names, signs * angles, strict=True)))
        there = robot.get_transform("tip", "base")[:3, 3]
        assert link_frames(machine, angles)[-1][:3, 3] == pytest.approx(there, abs=1e-9)
        assert Arm(machine).tip(angles) == pytest.approx(there, abs=1e-9)


@needs("mujoco")
def test_the_excavator_moves_and_weighs_as_mujoco_has_it() -> None:
    import mujoco

    machine = described(EXCAVATOR)
    assert machine.joints[0].a == pytest.approx(0.25)
    model = mujoco.MjModel.from_xml_path(str(EXAMPLES / "excavator.urdf"))
    data = mujoco.MjData(model)
    own = mujoco.MjModel.from_xml_string(urdf_of(machine))
    there = mujoco.MjData(own)
    signs = np.array([1.0, -1.0, -1.0, -1.0])  # the file lifts with positive angles
    for angles in poses(machine):
        data.qpos[:] = signs * angles
        mujoco.mj_forward(model, data)
        bucket = data.body("bucket")
        tip = bucket.xpos + bucket.xmat.reshape(3, 3) @ [1.5, 0.0, 0.0]
        assert Arm(machine).tip(angles) == pytest.approx(tip, abs=1e-9)
        there.qpos[:] = angles
        mujoco.mj_forward(own, there)
        # What holds it against its weight: masses and their centres.
        assert there.qfrc_bias == pytest.approx(signs * data.qfrc_bias, rel=1e-9, abs=1e-3)
        full, mine = np.zeros((4, 4)), np.zeros((4, 4))
        for number, unit in enumerate(np.eye(4)):
            mujoco.mj_mulM(model, data, full[number], unit)
            mujoco.mj_mulM(own, there, mine[number], unit)
        assert mine == pytest.approx(np.outer(signs, signs) * full, rel=1e-6, abs=1e-3)


def test_all_kinematics_agree_where_the_boom_stands_before_the_slew_axis() -> None:
    machine = Machine.model_validate(
        {
            "title": "any", "source": "none", "base_x": 0.3,
            "joints": [
                {"name": "slew", "a": 0.4, "d": 1.5, "alpha_deg": -90, "range_deg": [-170, 170],
                 "speed_deg_s": 30, "mass_kg": 1, "effort": 1},
                *({"name": f"p{n}", "a": 2.0, "range_deg": [-80, 80], "speed_deg_s": 20,
                   "mass_kg": 1, "effort": 1} for n in range(3)),
            ],
        }
    )  # fmt: skip
    state = CraneState(machine)
    for angles in poses(machine, 100):
        tip = link_frames(machine, angles)[-1][:3, 3]
        assert Arm(machine).tip(angles) == pytest.approx(tip, abs=1e-12)
        assert state.fill(angles, [0.1, 0.2, 0.3, 0.4])[8:11] == pytest.approx(tip, abs=1e-12)
    found = reach(machine, tip)
    assert found is not None
    assert Arm(machine).tip(found) == pytest.approx(tip, abs=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>', "'joint1' comes first and must slew"),
        ('0.024 0 0.128"/><axis xyz="0 1 0"/>', '0.024 0 0.128"/><axis xyz="0 0 1"/>',
         "joint 'joint3' must pitch about a horizontal axis, like all joints but the first"),
        ('0.124 0 0"/><axis xyz="0 1 0"/>', '0.124 0 0"/><axis xyz="1 0 0"/>',
         "the axes of 'joint2' and 'joint4' are not parallel"),
        ('<origin xyz="0.126 0 0"/>', '<origin xyz="0.126 0.02 0"/>',
         "the tip is 0.020 m beside the plane of the slew axis and must be in it"),
        ('xyz="0.012 0 0.017"', 'xyz="0.012 0.1 0.017"',
         "the axis of 'joint1' is 0.100 m beside the base's x axis; move the base under it"),
        ('velocity="4.8"', 'velocity="0"',
         "joint 'joint1' has no velocity; give it in the protocol, under speeds_deg_s"),
        ('name="joint4" type="revolute"', 'name="joint4" type="prismatic"',
         "joint 'joint4' is prismatic, and must be revolute"),
        ('<child link="gripper"/>', '<child link="link_4"/>', "link 'link_4' hangs on two joints"),
        ('<robot name', '<rabot name', "it cannot be read: mismatched tag"),
        ('xyz="0.126 0 0"', 'xyz="0.126 0"', "xyz='0.126 0' must be three numbers"),
        ('effort="1"', 'effort="one"', "'joint1': effort='one' is not a number"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named_with_its_joint(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    text = (EXAMPLES / "openmanipulator_x.urdf").read_text()
    assert old in text
    (tmp_path / "openmanipulator_x.urdf").write_text(text.replace(old, new, 1))
    with pytest.raises(ProtocolError) as refused:
        described(OMX, tmp_path)
    assert said in str(refused.value)


def test_names_that_are_not_there_are_answered_with_those_that_are() -> None:
    there = r"no joint 'joint9'; did you mean 'joint\d'\? it has joint1, joint2, joint3, joint4"
    with pytest.raises(ProtocolError, match=there):
        described({**OMX, "joints": ["joint1", "joint2", "joint9"]})
    with pytest.raises(ProtocolError, match=r"no link 'griper'; did you mean 'gripper'\?"):
        described({**OMX, "tip": "griper"})
    with pytest.raises(ProtocolError, match=r"are joint1, joint2, joint3, joint4.*; name"):
        described({**OMX, "joints": ["joint2", "joint1", "joint3"]})


def test_a_mesh_stands_where_the_file_has_it(tmp_path: Path) -> None:
    text, _, names = random_urdf(3)
    shape = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "link.stl").write_text(shape + "endloop\nendfacet\nendsolid a\n")
    look = (
        '<visual><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><geometry>'
        '<mesh filename="package://any/meshes/link.stl" scale="0.5 0.5 0.5"/></geometry></visual>'
    )
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "any.urdf").write_text(text.replace("<inertial>", look + "<inertial>"))
    called = {f"j{number}": name for number, name in enumerate(names)}
    fields = {"urdf": "robots/any.urdf", "joints": called, "tip": "tip"}
    machine = described(fields, tmp_path)
    assert described({**fields, "meshes": False}, tmp_path).joints[1].mesh is None
    import yourdfpy

    robot = yourdfpy.URDF.load(
        tmp_path / "robots" / "any.urdf", load_meshes=False, build_scene_graph=True
    )
    signs = signs_of(machine, (-1.1, 1.3))
    here = np.eye(4)
    here[:3, :3], here[:3, 3] = turned(0.4, 0.5, 0.6), [0.1, 0.2, 0.3]
    for angles in poses(machine, 20):
        robot.update_cfg(dict(zip(names, signs * angles, strict=True)))
        frames = link_frames(machine, angles)
        for number, joint in enumerate(machine.joints):
            assert joint.mesh is not None
            assert joint.mesh.scale == 0.5
            own = np.eye(4)
            own[:3, :3] = turned(*(math.radians(angle) for angle in joint.mesh.turn_deg))
            own[:3, 3] = joint.mesh.position
            there = robot.get_transform(f"L{number}", "base") @ here
            assert frames[number + 1] @ own == pytest.approx(there, abs=1e-6)
    (tmp_path / "meshes" / "link.stl").unlink()
    with pytest.raises(ProtocolError, match=r"meshes/link.stl' of 'L0' is not next to"):
        described(fields, tmp_path)


STUDY = """\
labcrane: 1
study: {word}
title: A machine of another program
rate_hz: 60
machine: {machine}
input: {{use: simulated_operator}}
scheme: {{use: joint_velocity, map: {map}}}
dynamics: {{use: {engine}}}
tasks:
  aiming: {{use: aiming, distances: [{distance}], width: {width}, movements: 1, limit_s: 3}}
sessions: [{{name: only, steps: [{{block: {{task: aiming, pairs: 1}}}}]}}]
"""


@pytest.mark.parametrize("engine", ["kinematic_crane", "mujoco_crane", "bullet_crane"])
def test_a_study_on_an_excavator_of_a_file_is_checked_run_and_replayed(
    engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from needs import need

    from labcrane.testing import main

    need("mujoco", *(["pybullet"] if engine == "bullet_crane" else []))
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "excavator.urdf").write_text((EXAMPLES / "excavator.urdf").read_text())
    axes = "{swing: left.x, boom: -right.y, stick: left.y, bucket: right.x}"
    path = folder / "protocol.yaml"
    path.write_text(
        STUDY.format(
            word="digging", machine=json.dumps(EXCAVATOR), map=axes, engine=engine, distance=2,
            width=0.5,
        )
    )  # fmt: skip
    assert main(["check", str(path)]) == 0, capsys.readouterr()
    assert "excavator" in capsys.readouterr().out
    run = ["run", str(path), "--participant", "P001", "--simulate", "--fast"]
    assert main(run) == 0, capsys.readouterr()
    (folder / "excavator.urdf").unlink()  # the record alone is enough
    recording = folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"
    capsys.readouterr()
    assert main(["replay", str(recording)]) == 0, capsys.readouterr()


MIMIC = """\
<robot name="levelled">
 <link name="base"/>{links}<link name="fork"/>
 <joint name="slew" type="revolute"><parent link="base"/><child link="l0"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>
 <joint name="lift" type="revolute"><parent link="l0"/><child link="l1"/><origin xyz=".2 0 .3"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
 <joint name="reach" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="2 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
 <joint name="level" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="1 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="1"/>{mimic}</joint>
 <joint name="bar" type="revolute"><parent link="l1"/><child link="l4"/><origin xyz=".5 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="9" velocity="1"/>{beside}</joint>
 <joint name="end" type="fixed"><parent link="l3"/><child link="fork"/><origin xyz=".6 0 0"/>
 </joint>
</robot>
"""
WEIGHT = '<mass value="9"/><inertia ixx="1" iyy="1" izz="1"/>'


def levelled(
    folder: Path, mimic: str, beside: str = "", joints: str = "slew lift reach", own: str = WEIGHT
) -> Machine:
    weights = (WEIGHT, WEIGHT, own, WEIGHT, WEIGHT)
    links = "".join(
        f'<link name="l{at}"><inertial>{each}</inertial></link>' for at, each in enumerate(weights)
    )
    (folder / "arm.urdf").write_text(MIMIC.format(links=links, mimic=mimic, beside=beside))
    return described({"urdf": "arm.urdf", "joints": joints.split(), "tip": "fork"}, folder)


@pytest.mark.parametrize(
    ("mimic", "joints", "said"),
    [
        ('<mimic joint="lift" multiplier="-1"/>', "slew lift reach", "'level' .* moves with lift"),
        ('<mimic joint="bar"/>', "slew lift reach", "'level' .* moves with lift"),
        ('<mimic joint="lift"/>', "slew lift reach level", "'level' .* moves with lift"),
        ('<mimic joint="end" offset="0.5"/>', "slew lift reach", "'level' .* moves with end"),
        ('<mimic joint="boom"/>', "slew lift reach", "mimics 'boom', which is not there"),
        ('<mimic joint="level"/>', "slew lift reach", "mimics 'level', which is not there or mim"),
    ],
)
def test_a_joint_that_mimics_another_on_the_way_to_the_tip_is_refused(
    mimic: str, joints: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(ProtocolError, match=said):
        levelled(tmp_path, mimic, '<mimic joint="lift" multiplier="2"/>', joints)


def test_a_joint_that_mimics_one_that_stays_or_is_elsewhere_changes_nothing(tmp_path: Path) -> None:
    plain = levelled(tmp_path, "")
    beside = levelled(tmp_path, '<mimic joint="end"/>', '<mimic joint="lift"/>')
    assert beside.joints == plain.joints


def test_the_rounding_of_a_file_is_taken_and_said(tmp_path: Path) -> None:
    """Pitch joints turned by pi/2 of four decimals, and a tip 0.4 mm aside."""
    text = (EXAMPLES / "openmanipulator_x.urdf").read_text()
    exact = described(OMX)
    turned = text.replace(
        '0.024 0 0.128"/><axis xyz="0 1 0"/>', '0.024 0 0.128"/><axis xyz="0 1 0.0000037"/>'
    ).replace('<origin xyz="0.126 0 0"/>', '<origin xyz="0.126 0.0004 0"/>')
    (tmp_path / "openmanipulator_x.urdf").write_text(turned)
    machine = described(OMX, tmp_path)
    assert exact.source == "openmanipulator_x.urdf"
    assert "up to 0.0002 degrees, and whose tip and slew axis up to 0.40 mm, off" in machine.source
    for angles in poses(exact, 50):
        assert Arm(machine).tip(angles) == pytest.approx(Arm(exact).tip(angles), abs=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('0.024 0 0.128"/><axis xyz="0 1 0"/>', '0.024 0 0.128"/><axis xyz="0 1 0.01"/>',
         "joint 'joint3' must pitch about a horizontal axis"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "'joint1' has the axis 0 0 0"),
        ("<link name", '<xacro:arm xmlns:xacro="http://wiki.ros.org/xacro"/><link name',
         "it is xacro, not yet URDF"),
    ],
)  # fmt: skip
def test_what_is_no_rounding_is_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = (EXAMPLES / "openmanipulator_x.urdf").read_text()
    assert old in text
    (tmp_path / "openmanipulator_x.urdf").write_text(text.replace(old, new, 1))
    with pytest.raises(ProtocolError, match=said):
        described(OMX, tmp_path)


def test_a_limit_that_is_not_written_is_zero(tmp_path: Path) -> None:
    text = (EXAMPLES / "openmanipulator_x.urdf").read_text()
    lower = re.search(r'lower="[^"]*" ', text)[0]
    (tmp_path / "openmanipulator_x.urdf").write_text(text.replace(lower, "", 1))
    machine = described(OMX, tmp_path)
    assert machine.limits[0][0] == 0.0
    upper = re.search(r'upper="[^"]*" ', text)[0]
    without = text.replace(lower, "", 1).replace(upper, "", 1)
    (tmp_path / "openmanipulator_x.urdf").write_text(without)
    with pytest.raises(ProtocolError, match="'joint1' goes from 0 to 0 rad by its"):
        described(OMX, tmp_path)


def inertia_of(moments: np.ndarray, dice: np.random.Generator) -> str:
    """Return a body's moments of inertia, turned at random, as URDF has them."""
    turn, _ = np.linalg.qr(dice.normal(size=(3, 3)))
    full = turn @ np.diag(moments) @ turn.T
    at = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    return " ".join(f'{name}="{float(full[place])!r}"' for name, place in at.items())


def with_inertia(folder: Path, inertia: str, mass: float = 9.0) -> Machine:
    return levelled(folder, "", own=f'<mass value="{mass}"/><inertia {inertia}/>')


@pytest.mark.parametrize("seed", range(8))
def test_an_inertia_that_bodies_have_is_taken_and_any_other_refused(
    seed: int, tmp_path: Path
) -> None:
    """Bodies are points drawn at random, each with a mass; so their moments are possible ones."""
    dice = np.random.default_rng(seed)
    points, masses = dice.normal(size=(9, 3)), dice.uniform(0.1, 5.0, 9)
    spread = np.cov(points.T, aweights=masses, bias=True) * masses.sum()
    moments = np.linalg.eigvalsh(np.trace(spread) * np.eye(3) - spread)
    with_inertia(tmp_path, inertia_of(moments, dice))
    negative = moments * np.array([-1.0, 1.0, 1.0])
    unequal = np.array([*moments[:2], (moments[0] + moments[1]) * dice.uniform(1.001, 3.0)])
    for wrong, said in (
        (negative, "above 0"),
        (unequal, "sum of the others"),
        (0 * moments, "above 0"),
    ):
        with pytest.raises(ProtocolError, match=f"link 'l2' has the principal moments.*{said}"):
            with_inertia(tmp_path, inertia_of(wrong, dice))
    with pytest.raises(ProtocolError, match="link 'l2' has a mass of -3 kg"):
        with_inertia(tmp_path, inertia_of(moments, dice), mass=-3.0)
