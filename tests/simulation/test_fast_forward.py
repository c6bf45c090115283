"""Compiled kernels and the loop: the same bits, whatever the study; and which of them ran."""

import json
import random
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from needs import need

from labcrane import open_recording
from labcrane.machines.library import find_machine
from labcrane.simulation import fast_forward
from labcrane.simulation.simulation import WAY, SimulationJob, simulate

AHEAD = "ahead.yaml"
CH8 = ("slew", "shoulder", "elbow", "wrist")

HEAD = """\
labcrane: 1
study: kernels
title: Drawn at random
participants: {pattern: 'P\\d{3}', planned: 12}
input: {use: dual_joystick}
"""
JOINTS = "map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}"
BASE = "map: {x: left.y, y: -left.x, z: right.y}, frame: base"
ARM = "map: {radial: left.y, tangential: -left.x, vertical: right.y}, frame: arm"


def drawn_study(seed: int, scheme: str, rule: str) -> str:
    """Return a protocol with everything that a kernel must follow drawn at random."""
    draw = random.Random(seed)

    def handling() -> str:
        dead = round(draw.uniform(0.0, 0.2), 3)
        stop = round(draw.choice([0.0, draw.uniform(1.0, 40.0)]), 2)
        expo = draw.choice([0.0, 1.0, round(draw.random(), 3)])
        return f"dead_zone: {dead}, expo: {expo}, soft_stop_deg: {stop}"

    def tip() -> str:
        where = {"base": BASE, "arm": ARM}.get(scheme) or draw.choice([BASE, ARM])
        threshold = round(draw.uniform(0.2, 3.0), 2)
        speed = round(draw.uniform(0.3, 1.5), 2)
        return f"{where}, {handling()}, threshold_m: {threshold}, speed_m_s: {speed}"

    match scheme:
        case "joint_velocity":
            speed = round(draw.uniform(0.5, 1), 2)
            law = f"use: joint_velocity, {JOINTS}, {handling()}, speed: {speed}"
        case "switchable":
            start = draw.choice(["joint_velocity", "end_effector"])
            law = (
                f"use: switchable, button: right.trigger, start: {start}, joint_velocity: "
                f"{{{JOINTS}, {handling()}}}, end_effector: {{{tip()}}}"
            )
        case _:
            law = f"use: end_effector, {tip()}"
    actuator = draw.choice(["ideal", "electric", "hydraulic", "sluggish"])
    operator = (
        f"operator: {{use: simulated_operator, lapse_rate: 0.3, motor_noise: "
        f"{round(draw.uniform(0, 0.2), 3)}, endpoint_noise: {round(draw.uniform(0, 0.15), 3)}}}"
    )
    task = (
        f"tasks: {{aiming: {{use: aiming, distances: [{draw.choice([2, 3])}], movements: 2, "
        f"width: {draw.choice([0.3, 0.8])}, end: {rule}, limit_s: {draw.choice([4, 12])}, "
        f"rest_after: {round(draw.uniform(0.1, 1), 2)}}}}}"
    )
    return "\n".join(
        [
            HEAD + f"rate_hz: {draw.choice([60, 100, 240])}",
            f"machine: {draw.choice(['ch8', 'ch8_cranelike', AHEAD])}",
            f"scheme: {{{law}}}",
            operator,
            f"dynamics: {{use: kinematic_crane, actuator: {actuator}}}",
            task,
            "sessions: [{name: one, steps: [{block: {task: aiming}}, {block: {task: aiming}}]}]",
            "",
        ]
    )


def written(folder: Path, text: str) -> Path:
    """Write a study, and beside it a machine whose boom stands before its slew axis."""
    ch8 = find_machine("ch8").read_text(encoding="utf-8")
    assert "name: slew, d:" in ch8
    (folder / AHEAD).write_text(ch8.replace("name: slew, d:", "name: slew, a: 0.3, d:"))
    (folder / "protocol.yaml").write_text(text)
    return folder / "protocol.yaml"


def held(path: Path) -> dict[str, tuple[str, bytes]]:
    """Return every number of a participant file, to the bit, and everything else as text."""
    found: dict[str, tuple[str, bytes]] = {}

    def take(name: str, node: h5py.Group | h5py.Dataset) -> None:
        told = repr(sorted((key, str(value)) for key, value in node.attrs.items()))
        content = b""
        if isinstance(node, h5py.Dataset):
            values = node[()]
            plain = isinstance(values, np.ndarray) and values.dtype.kind in "fiub"
            content = values.tobytes() if plain else repr(values).encode()
        found[name] = (told, content)

    with h5py.File(path) as file:
        file.visititems(take)
    return found


def simulated(protocol: Path, data: Path, loop: str = "") -> tuple[Path, dict[str, object]]:
    folder = simulate(SimulationJob(protocol, None, data, "P001", loop))
    (way,) = json.loads((folder.path / WAY).read_text())
    return folder.path, way


SCHEMES = ("joint_velocity", "base", "arm", "switchable")
RULES = ("rest_inside", "rest_anywhere", "trigger")


@pytest.mark.long
@pytest.mark.parametrize(
    ("scheme", "rule"), [(scheme, rule) for scheme in SCHEMES for rule in RULES]
)
def test_kernels_make_the_bits_of_the_loop_in_journals_and_participant_files(
    tmp_path: Path, scheme: str, rule: str
):
    need("numba")
    seed = SCHEMES.index(scheme) * 3 + RULES.index(rule)
    protocol = written(tmp_path, drawn_study(seed, scheme, rule))
    fast, way = simulated(protocol, tmp_path / "fast")
    slow, other = simulated(protocol, tmp_path / "slow", "asked for")
    assert way["compiled"] is True
    assert other == {"compiled": False, "why": "asked for", "deviation": 0.0}
    journals = sorted(path.relative_to(fast) for path in fast.rglob("*.xdf"))
    assert journals
    for journal in journals:
        assert (fast / journal).read_bytes() == (slow / journal).read_bytes()
    (file,) = fast.glob("*.h5")
    assert held(file) == held(slow / file.name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "package"), [("bullet_crane", "pybullet"), ("mujoco_crane", "mujoco")]
)
@pytest.mark.parametrize("rule", RULES)
def test_an_engine_goes_on_where_its_kernel_came_so_that_both_ways_do_the_same_study(
    tmp_path: Path, engine: str, package: str, rule: str
):
    need("numba", package)
    text = drawn_study(RULES.index(rule), "joint_velocity", rule)
    text = text.replace("kinematic_crane", engine).replace(AHEAD, "ch8")
    protocol = written(tmp_path, text)
    fast, way = simulated(protocol, tmp_path / "fast")
    slow, _ = simulated(protocol, tmp_path / "slow", "asked for")
    assert (way["compiled"], way["deviation"]) == (True, 1e-9)
    one, other = (
        open_recording(folder / f"{folder.name}.h5").session(1) for folder in (fast, slow)
    )
    told = ["outcome", "ticks", "started", "ended"]
    told = [name for name in told if name in one.trials]
    assert "outcome" in told
    pd.testing.assert_frame_equal(one.trials[told], other.trials[told], rtol=0.0, atol=0.0)
    joints = [
        np.column_stack([session.streams["state"].column(f"joint.angle.{name}") for name in CH8])
        for session in (one, other)
    ]
    assert joints[0].shape == joints[1].shape
    assert np.ptp(joints[0], axis=0).min() > 0.01, "every joint moves"
    assert np.abs(joints[0] - joints[1]).max() < 1e-6


@pytest.mark.long
def test_a_study_with_one_component_without_a_kernel_is_simulated_by_the_loop_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    need("numba")
    from labcrane_schemes.joint_velocity import JointVelocity

    monkeypatch.setattr(JointVelocity, "kernel", lambda scheme: None)
    protocol = tmp_path / "protocol.yaml"
    written(tmp_path, drawn_study(1, "joint_velocity", "rest_inside"))
    _, way = simulated(protocol, tmp_path / "data")
    assert way["compiled"] is False
    assert way["why"] == "scheme has no compiled kernel"


def test_without_numba_the_loop_simulates_and_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(fast_forward, "find_spec", lambda name: None)
    protocol = tmp_path / "protocol.yaml"
    text = drawn_study(1, "joint_velocity", "rest_inside")
    written(tmp_path, text.replace("limit_s: 12", "limit_s: 4"))
    _, way = simulated(protocol, tmp_path / "data")
    assert way["compiled"] is False
    assert way["why"] == "numba is not installed; labcrane[fast] brings it"
