"""The engines against the velocity law, other geometries, and itself."""

import hashlib
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from cranes import (
    build,
    cranes,
    drive,
    engines,
    machines,
    needs_bullet,
    random_poses,
    random_sticks,
    rates,
    standing,
)
from programs import ran

from labcrane import FloatArray, Machine
from labcrane.machines import ACTUATOR_PRESETS, Arm, link_frames, load_machine
from labcrane.testing import RATE_HZ, ch8


class Engine:
    """PyBullet without labcrane's crane around it: reads a machine's URDF and poses it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextmanager
    def loaded(self, machine: Machine) -> Iterator["Engine"]:
        import pybullet

        from labcrane.machines import urdf_of

        self.bullet = pybullet
        (self.folder / "crane.urdf").write_text(urdf_of(machine), encoding="utf-8")
        self.client = pybullet.connect(pybullet.DIRECT)
        try:
            self.body = pybullet.loadURDF(
                str(self.folder / "crane.urdf"), useFixedBase=True, physicsClientId=self.client
            )
            self.beam = machine.joints[-1].a
            yield self
        finally:
            pybullet.disconnect(physicsClientId=self.client)

    def links(self, pose: list[float]) -> list[tuple[tuple[float, ...], ...]]:
        for joint, angle in enumerate(pose):
            self.bullet.resetJointState(self.body, joint, angle, physicsClientId=self.client)
        return [
            self.bullet.getLinkState(
                self.body, joint, computeForwardKinematics=1, physicsClientId=self.client
            )
            for joint in range(len(pose))
        ]

    def tip(self, pose: list[float]) -> FloatArray:
        """Return half a beam beyond the last mass, in m.

        Masses are in double precision; the engine gives link frames in single precision only.
        """
        centre, (x, y, z, w), *_ = self.links(pose)[-1]
        along = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
        return np.add(centre, np.multiply(0.5 * self.beam, along))

    def masses(self, pose: list[float]) -> list[tuple[float, ...]]:
        return [link[0] for link in self.links(pose)]


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return Engine(tmp_path)


@engines
@machines
@rates
@pytest.mark.parametrize("actuator", ACTUATOR_PRESETS)
def test_an_engine_follows_the_velocity_law(
    name: str, model: str, rate_hz: float, actuator: str
) -> None:
    """Tolerance 1e-9: commands that the motors are strong enough for are met exactly."""
    machine = load_machine(model)
    commands = random_sticks(machine, rate_hz, 10.0)
    paths = []
    for each in (name, "kinematic_crane"):
        with standing(each, machine, rate_hz, actuator) as crane:
            paths.append(drive(crane, commands, rate_hz))
    assert np.ptp(paths[1][:, :4], axis=0).min() > np.radians(1), "every joint moves"
    np.testing.assert_allclose(paths[0][:, :14], paths[1], rtol=0, atol=1e-9)


@engines
@rates
def test_only_the_efforts_part_an_engine_from_the_law(name: str, rate_hz: float) -> None:
    """Random steps of command ask for any torque: with strong motors they too are met exactly."""
    machine = ch8()
    strong = tuple(joint.model_copy(update={"effort": 1e9}) for joint in machine.joints)
    steps = np.random.default_rng(4).uniform(-0.5, 0.5, (20, 4)) * machine.speeds
    commands = np.repeat(steps, round(rate_hz / 4), axis=0)
    gaps = {}
    for model in (machine, machine.model_copy(update={"joints": strong})):
        paths = []
        for each in (name, "kinematic_crane"):
            with standing(each, model, rate_hz) as crane:
                crane.reset([0.0] * 4)
                paths.append(drive(crane, commands, rate_hz))
        gaps[model is machine] = np.abs(paths[0][:, :4] - paths[1][:, :4]).max()
    assert gaps[False] < 1e-6
    assert 1e-4 < gaps[True] < np.radians(2.0), "real motors take time to turn the arm round"


@needs_bullet
@machines
def test_engine_matrices_and_scalars_put_the_tip_in_the_same_place(
    model: str, engine: Engine
) -> None:
    machine = load_machine(model)
    arm = Arm(machine)
    with engine.loaded(machine) as body:
        for pose in random_poses(machine, 1000).tolist():
            tip = body.tip(pose)
            np.testing.assert_allclose(
                link_frames(machine, pose)[-1, :3, 3], tip, rtol=0, atol=1e-6
            )
            np.testing.assert_allclose(arm.tip(pose), tip, rtol=0, atol=1e-6)


@cranes
@machines
def test_a_crane_stands_where_it_was_put(name: str, model: str) -> None:
    machine = load_machine(model)
    with standing(name, machine) as crane:
        for pose in random_poses(machine, 20).tolist():
            crane.reset(pose)
            for state in (crane.state(), crane.step(np.zeros(4), 1 / RATE_HZ)):
                np.testing.assert_allclose(state[:4], pose, rtol=0, atol=1e-7)
                np.testing.assert_allclose(
                    state[8:11], link_frames(machine, pose)[-1, :3, 3], rtol=0, atol=1e-6
                )


@needs_bullet
@machines
def test_boxes_are_drawn_where_the_engine_has_the_masses(model: str, engine: Engine) -> None:
    machine = load_machine(model)
    boxes = [body for body in build("bullet_crane", machine).bodies() if body.frame]
    assert [box.name for box in boxes] == list(machine.names)
    with engine.loaded(machine) as body:
        for pose in random_poses(machine, 20).tolist():
            placed = link_frames(machine, pose)
            for box, mass in zip(boxes, body.masses(pose), strict=True):
                centre = placed[box.frame] @ [*box.centre, 1.0]
                np.testing.assert_allclose(centre[:3], mass, rtol=0, atol=1e-9)


PROGRAM = """
import hashlib, sys
import numpy as np
from labcrane.testing import make_run, ch8, RATE_HZ
import labcrane_bullet, labcrane_mujoco
name, actuator = sys.argv[1:]
offers = (*labcrane_bullet.labcrane_dynamics(), *labcrane_mujoco.labcrane_dynamics())
(offer,) = (offer for offer in offers if offer.name == name)
crane = offer.build(offer.settings.model_validate({"actuator": actuator}), ch8())
crane.open(make_run(ch8()))
random, digest = np.random.default_rng(7), hashlib.sha256()
for command in np.repeat(random.uniform(-1, 1, (40, 4)), 60, axis=0) * ch8().speeds:
    digest.update(crane.step(command, 1 / RATE_HZ).tobytes())
crane.close()
print("states", digest.hexdigest())
"""


def digest_of_another_process(name: str, actuator: str) -> str:
    finished = ran([sys.executable, "-c", PROGRAM, name, actuator], check=True)
    (line,) = (line for line in finished.stdout.splitlines() if line.startswith("states"))
    return line.split()[1]


@pytest.mark.slow
@cranes
@pytest.mark.parametrize("actuator", ["ideal", "hydraulic"])
def test_two_processes_get_the_same_bits(name: str, actuator: str) -> None:
    first, second = (digest_of_another_process(name, actuator) for _ in range(2))
    assert first == second


@cranes
def test_a_crane_that_has_hit_its_limits_resets_to_the_bits_of_a_new_one(name: str) -> None:
    machine = ch8()
    commands = random_sticks(machine, RATE_HZ, 3.0)
    digests = []
    for wild in (False, True):
        with standing(name, machine) as crane:
            if wild:
                drive(crane, np.tile(machine.speeds, (2400, 1)))
                crane.reset(machine.rest)
            digests.append(hashlib.sha256(drive(crane, commands).tobytes()).hexdigest())
    assert digests[0] == digests[1]


@engines
def test_two_cranes_in_one_process_leave_each_other_alone(name: str) -> None:
    machine = ch8()
    commands = random_sticks(machine, RATE_HZ, 1.0)
    with standing(name, machine) as crane:
        alone = drive(crane, commands)
    with (
        standing(name, machine) as crane,
        standing(name, machine) as other,
    ):
        beside = []
        for command in commands:
            other.step(-command, 1 / RATE_HZ)
            beside.append(crane.step(command, 1 / RATE_HZ).copy())
    np.testing.assert_array_equal(beside, alone)


@needs_bullet
@rates
@pytest.mark.parametrize("share", [0.2, 1.0])
def test_torques_worked_out_before_the_step_change_its_time_only(
    rate_hz: float, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full steps of command ask for more than the motors have, gentle ones do not."""
    from labcrane_bullet.bullet_crane import BulletCrane

    machine = ch8()
    steps = np.random.default_rng(9).uniform(-share, share, (12, 4)) * machine.speeds
    commands = np.repeat(steps, round(rate_hz / 4), axis=0)
    if share < 1.0:
        commands = random_sticks(machine, rate_hz, 3.0)
    paths, passes = [], []
    enough = BulletCrane._enough

    def count(crane: BulletCrane, speeds: list[float]) -> Sequence[float] | None:
        torques = enough(crane, speeds)
        passes.append(torques is not None)
        return torques

    for decide in (count, lambda crane, speeds: None):
        monkeypatch.setattr(BulletCrane, "_enough", decide)
        with standing("bullet_crane", machine, rate_hz) as crane:
            paths.append(drive(crane, commands, rate_hz))
    assert all(passes) == (share < 1.0), "either kind of tick is tried"
    np.testing.assert_allclose(paths[0][:, :8], paths[1][:, :8], rtol=0, atol=1e-6)
