"""What the cranes find, refuse, leave behind and tell the record."""

import re
import sys
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from cranes import build, cranes, needs_bullet, standing

from labcrane import Dynamics, PluginError, ProtocolError, Signal
from labcrane.testing import RATE_HZ, ch8, discover, make_run


@cranes
def test_the_joints_command_is_found_wherever_it_stands(name: str) -> None:
    machine = ch8()
    command = (
        Signal("wish", "m/s", ("x", "y")),
        Signal("command", "rad/s", machine.names),
        Signal("scale", "1"),
    )
    crane = build(name, machine)
    crane.open(make_run(machine, command=command))
    with closing(crane):
        wanted = 0.1 * np.array(machine.speeds)
        pushed = np.array([9.0, 9.0, *wanted, 9.0])
        for _ in range(60):
            state = crane.step(pushed, 1 / RATE_HZ)
        np.testing.assert_allclose(state[4:8], wanted, rtol=1e-6)


@cranes
def test_a_scheme_for_another_machine_is_refused(name: str) -> None:
    crane = build(name, ch8())
    two = (Signal("command", "rad/s", ("slew", "boom")),)
    with pytest.raises(ProtocolError, match=r"commands 2 joints; this machine has 4 \(slew,"):
        crane.open(make_run(ch8(), command=two))
    crane.close()


@cranes
def test_a_pose_the_machine_cannot_take_is_refused(name: str) -> None:
    with standing(name, ch8()) as crane:
        with pytest.raises(ProtocolError, match=r"elbow at 90\.00 degrees.*from -86 to 86"):
            crane.reset([0.0, 0.0, np.radians(90), 0.0])
        with pytest.raises(ProtocolError, match=r"pose of 2 angles.*has 4 joints"):
            crane.reset([0.0, 0.0])


@cranes
def test_a_tick_of_another_length_is_refused(name: str) -> None:
    with (
        standing(name, ch8()) as crane,
        pytest.raises(PluginError, match=r"step of 0\.01 s.*ticks of 0\.00416667 s"),
    ):
        crane.step(np.zeros(4), 0.01)


@cranes
def test_a_crane_closes_twice_and_without_having_been_opened(name: str) -> None:
    crane = build(name, ch8())
    crane.close()
    crane.open(make_run(ch8()))
    crane.close()
    crane.close()


@needs_bullet
def test_the_engine_leaves_no_file_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with standing("bullet_crane", ch8()):
        assert [file.name for file in tmp_path.rglob("*.urdf")] == ["crane.urdf"]
    assert not list(tmp_path.iterdir())


@cranes
def test_the_record_says_which_delays_were_used(name: str) -> None:
    facts: Mapping[str, object] = build(name, ch8(), "hydraulic").metadata()
    assert facts["actuator.dead_time_s"] == 0.06
    assert facts["actuator.lag_s"] == 0.15
    assert facts["actuator.rate_limit"] == 4.0
    engines = {"kinematic_crane": "", "bullet_crane": "pybullet", "mujoco_crane": "mujoco"}
    assert str(facts.get("engine", "")).partition(" ")[0] == engines[name]


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_without_an_engine_the_other_cranes_are_named(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, engine, None)
    offers = discover().offers[Dynamics]
    crane = {"pybullet": "bullet_crane", "mujoco": "mujoco_crane"}[engine]
    assert re.match(rf"needs {engine}, .*'kinematic_crane'", offers[crane].missing)
    assert not offers["kinematic_crane"].missing
    build("kinematic_crane", ch8())
