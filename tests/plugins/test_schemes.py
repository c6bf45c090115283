"""The schemes against closed forms, and against the machine integrated exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scheme_setups import (
    ARM,
    LOW,
    MACHINES,
    end_effector,
    joint_velocity,
    push,
    ready,
    switchable,
)

from labcrane import Controller, Settings
from labcrane.machines import jacobian
from labcrane.testing import (
    RATE_HZ,
    ControllerContract,
    ch8,
    crane_at,
    make_trial,
)
from labcrane_schemes import labcrane_controllers
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.law import block, shape, unshape
from labcrane_schemes.switchable import Switchable


def build(name: str, settings: Settings) -> Controller:
    (offer,) = (offer for offer in labcrane_controllers() if offer.name == name)
    return offer.build(settings, ch8())


class TestJointVelocity(ControllerContract):
    @pytest.fixture
    def controller(self) -> Controller:
        return build("joint_velocity", joint_velocity(expo=0.3))


class TestEndEffector(ControllerContract):
    @pytest.fixture(params=["base", "arm"])
    def controller(self, request: pytest.FixtureRequest) -> Controller:
        settings = end_effector(frame="arm", map=ARM) if request.param == "arm" else end_effector()
        return build("end_effector", settings)


class TestSwitchable(ControllerContract):
    @pytest.fixture(params=["joint_velocity", "end_effector"])
    def controller(self, request: pytest.FixtureRequest) -> Controller:
        return build("switchable", switchable(start=request.param))


# --- what a stick asks for


def shaped(dead_zone: float, expo: float) -> list[float]:
    return block(ch8(), joint_velocity(dead_zone=dead_zone, expo=expo), ch8().speeds)


def test_the_dead_zone_is_rescaled_from_its_edge_without_a_jump() -> None:
    own = shaped(0.05, 0.0)
    assert shape(own, 0, 0.05) == shape(own, 0, -0.05) == 0.0
    assert shape(own, 0, 0.05 + 1e-9) == pytest.approx(1e-9 / 0.95)
    assert shape(own, 0, 0.525) == pytest.approx(0.5)
    assert shape(own, 0, 1.0) == 1.0
    assert shape(own, 0, -1.0) == -1.0


def test_expo_mixes_a_cube_into_the_deflection() -> None:
    own = shaped(0.0, 0.25)
    for x in np.linspace(-1, 1, 21):
        assert shape(own, 0, x) == pytest.approx(0.75 * x + 0.25 * x**3, abs=1e-15)


@given(
    dead_zone=st.floats(0.0, 0.5),
    expo=st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)),
    share=st.floats(-1.0, 1.0),
)
def test_unshaping_inverts_shaping(dead_zone: float, expo: float, share: float) -> None:
    own = shaped(dead_zone, expo)
    pushed = unshape(own, 0, share)
    assert abs(pushed) <= 1.0
    assert shape(own, 0, pushed) == pytest.approx(share, abs=1e-12)


def test_full_deflection_is_a_fraction_of_the_joint_speed_with_the_sign_of_the_map() -> None:
    machine = ch8()
    scheme = ready(JointVelocity(joint_velocity(speed=0.5), machine), machine)
    state = crane_at(machine, machine.rest)
    command = scheme.command(push(left_x=1, left_y=-1, right_x=1, right_y=1), state)
    np.testing.assert_allclose(command[:4], 0.5 * np.array(machine.speeds) * [1, -1, -1, 1])


# --- from hands to joints, and back


def test_minimum_norm_is_the_pseudo_inverse_away_from_limits() -> None:
    machine = ch8()
    scheme = ready(EndEffector(end_effector(), machine), machine)
    random = np.random.default_rng(3)
    for _ in range(50):
        pose = LOW["ch8"] + random.uniform(-0.2, 0.2, 4)
        velocity = random.uniform(-0.2, 0.2, 3)
        state = crane_at(machine, pose.tolist())
        command = scheme.command(scheme.inverse(velocity, state), state)
        expected = np.linalg.pinv(jacobian(machine, pose.tolist())) @ velocity
        np.testing.assert_allclose(command[:4], expected, atol=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_steering_inverts_every_scheme(name: str) -> None:
    machine = MACHINES[name]
    shape = {"dead_zone": 0.1, "expo": 0.5}
    schemes: list[Controller] = [
        JointVelocity(joint_velocity(**shape), machine),
        EndEffector(end_effector(**shape), machine),
        EndEffector(end_effector(frame="arm", map=ARM, **shape), machine),
        Switchable(switchable(start="end_effector"), machine),
    ]
    random = np.random.default_rng(5)
    for scheme in schemes:
        ready(scheme, machine)
        for _ in range(40):
            pose = LOW[name] + random.uniform(-0.15, 0.15, 4)
            pose[0] = random.uniform(-2.5, 2.5)
            state = crane_at(machine, pose.tolist())
            velocity = random.uniform(-0.25, 0.25, 3)
            command = scheme.command(scheme.inverse(velocity, state), state)
            got = jacobian(machine, pose.tolist()) @ command[:4]
            np.testing.assert_allclose(got, velocity, atol=1e-9)


@pytest.mark.parametrize("scheme_class", [JointVelocity, EndEffector])
def test_a_hand_that_would_need_more_pushes_in_the_same_direction(scheme_class: type) -> None:
    machine = ch8()
    settings = joint_velocity() if scheme_class is JointVelocity else end_effector()
    scheme = ready(scheme_class(settings, machine), machine)
    state = crane_at(machine, LOW["ch8"].tolist())
    velocity = np.array([-20.0, 10.0, 5.0])
    axes = scheme.inverse(velocity, state)
    assert np.abs(axes).max() == pytest.approx(1.0)
    got = jacobian(machine, LOW["ch8"].tolist()) @ scheme.command(axes, state)[:4]
    cosine = got @ velocity / np.linalg.norm(got) / np.linalg.norm(velocity)
    assert cosine == pytest.approx(1.0, abs=1e-12)


def test_arm_directions_turn_with_the_slew() -> None:
    machine = ch8()
    scheme = ready(EndEffector(end_effector(frame="arm", map=ARM), machine), machine)
    for slew in (-2.0, 0.0, 1.0):
        pose = [slew, *LOW["ch8"][1:].tolist()]
        state = crane_at(machine, pose)
        out = jacobian(machine, pose) @ scheme.command(push(left_y=1), state)[:4]
        np.testing.assert_allclose(out, [0.5 * np.cos(slew), 0.5 * np.sin(slew), 0], atol=1e-12)
        side = jacobian(machine, pose) @ scheme.command(push(left_x=-1), state)[:4]
        np.testing.assert_allclose(side, [-0.5 * np.sin(slew), 0.5 * np.cos(slew), 0], atol=1e-12)


def test_over_the_slew_axis_the_tangential_direction_fades_out() -> None:
    machine = ch8()
    scheme = ready(EndEffector(end_effector(frame="arm", map=ARM), machine), machine)
    speeds = []
    for shoulder in np.radians(np.linspace(-80, 80, 4001)):
        pose = [0.0, shoulder, np.radians(-30.0), np.radians(-20.0)]
        state = crane_at(machine, pose)
        command = scheme.command(push(left_x=-1), state)
        speeds.append((state[8] - machine.base_x, command[0]))
    radius, slew = np.array(speeds).T
    assert radius.min() < 0.0 < radius.max()
    assert np.abs(slew).max() <= machine.speeds[0] * (1 + 1e-12)
    assert abs(slew[np.abs(radius).argmin()]) < 0.05
    assert (slew * radius >= 0.0).all(), "folded over, the slew turns the other way"


# --- switching


def test_the_button_switches_on_its_rising_edge_and_every_tick_says_what_is_active() -> None:
    machine = ch8()
    scheme = ready(Switchable(switchable(), machine), machine)
    state = crane_at(machine, LOW["ch8"].tolist())
    active = [
        scheme.command(push(left_y=1, right_trigger=button), state)[-1]
        for button in (0, 1, 1, 1, 0, 0, 1, 0, 1, 1)
    ]
    assert active == [0, 1, 1, 1, 1, 1, 0, 0, 1, 1]
    assert scheme.idle()[-1] == 1


def test_each_scheme_commands_what_it_commands_alone() -> None:
    machine = ch8()
    scheme = ready(Switchable(switchable(), machine), machine)
    joint = ready(JointVelocity(joint_velocity(), machine), machine)
    tip = ready(EndEffector(end_effector(), machine), machine)
    state = crane_at(machine, LOW["ch8"].tolist())
    hands = push(left_x=0.4, left_y=-0.7, right_y=0.2)
    np.testing.assert_array_equal(scheme.command(hands, state)[:-1], joint.command(hands, state))
    scheme.command(push(), state)
    hands[-1] = 1.0
    for _ in range(round(RATE_HZ)):  # longer than a change takes
        scheme.command(hands, state)
    np.testing.assert_array_equal(scheme.command(hands, state)[:-1], tip.command(hands, state))


def test_a_button_held_from_the_last_trial_does_not_switch() -> None:
    machine = ch8()
    scheme = ready(Switchable(switchable(), machine), machine)
    state = crane_at(machine, machine.rest)
    scheme.command(push(), state)
    assert scheme.command(push(right_trigger=1), state)[-1] == 1
    scheme.begin_trial(make_trial())
    assert scheme.command(push(right_trigger=1), state)[-1] == 0


def test_at_rest_nothing_is_limited() -> None:
    for scheme in (JointVelocity(joint_velocity(), ch8()), EndEffector(end_effector(), ch8())):
        np.testing.assert_array_equal(scheme.idle(), [0, 0, 0, 0, 1, 1, 1, 1, 1])


# --- what a protocol gets wrong
