"""The simulated operator in the closed loop: real schemes, a crane integrated exactly."""

import math
from pathlib import Path

import numpy as np
import pytest
from ideal_crane import IdealCrane
from operator_loop import DISTANCES, RADIUS, SCHEMES, Loop, ends
from rehearsal import SHORT, a_study, rehearse

from labcrane import InputDevice, Trial
from labcrane.core import Phase, PlannedTrial
from labcrane.machines import ACTUATOR_PRESETS, load_machine
from labcrane.protocol.questions import questions
from labcrane.testing import RATE_HZ, InputContract, ch8
from labcrane_operator import labcrane_inputs, law
from labcrane_operator.aimer import Aimer
from labcrane_operator.noise import Noise
from labcrane_operator.settings import OperatorSettings, TowardSettings

PRACTISED = {"learning_gain": 0.0}
STEADY = PRACTISED | {
    "reaction_sd": 0.0,
    "endpoint_noise": 0.0,
    "motor_noise": 0.0,
}


def times(scheme: str, seeds: range, **settings: float) -> dict[float, list[float]]:
    """Return the times in s of movements between the ends of each distance."""
    found: dict[float, list[float]] = {}
    for distance in DISTANCES:
        near, far = ends(distance)
        for seed in seeds:
            loop = Loop(scheme, settings)
            assert loop.trial(near, seed).reached_s is not None
            done = loop.trial(far, seed + 1000)
            assert done.reached_s is not None
            found.setdefault(distance, []).append(done.reached_s)
    return found


class TestSimulatedOperator(InputContract):
    @pytest.fixture
    def device(self) -> InputDevice:
        offer = {offer.name: offer for offer in labcrane_inputs()}["simulated_operator"]
        return offer.build(OperatorSettings(), ch8())


class TestTowardTarget(InputContract):
    @pytest.fixture
    def device(self) -> InputDevice:
        offer = {offer.name: offer for offer in labcrane_inputs()}["toward_target"]
        return offer.build(TowardSettings(), ch8())


class TestSimulatedOperatorOnOtherAxes(InputContract):
    @pytest.fixture
    def device(self) -> InputDevice:
        offer = {offer.name: offer for offer in labcrane_inputs()}["simulated_operator"]
        settings = OperatorSettings(axes=("keyboard.a", "keyboard.b"), button="keyboard.c")
        return offer.build(settings, ch8())


JOINTS = {"slew": "left.x", "elbow": "left.y", "wrist": "right.x", "shoulder": "-right.y"}
KEYS = "{use: keyboard, view: front, axes: {a: [a, d], b: [s, w], c: [j, l], e: [k, i], t: [g, f]}}"
VIEW = "views: {front: {use: view, keys: [a, d, s, w, j, l, k, i, g, f]}}\nsessions:"


@pytest.mark.slow
@pytest.mark.parametrize("end", ["rest_inside", "trigger"])
def test_hands_on_a_keyboard_move_as_those_on_two_joysticks(tmp_path: Path, end: str) -> None:
    sticks = SHORT.replace("movements: 2", f"movements: 2, end: {end}")
    keys = sticks.replace("input: {use: dual_joystick}", f"input: {KEYS}")
    keys = keys.replace("sessions:", VIEW).replace(
        f"end: {end}", f"end: {end}, trigger: keyboard.t"
    )
    names = dict(zip(JOINTS.values(), ("a", "b", "c", "-e"), strict=True))
    for axis, name in names.items():
        keys = keys.replace(axis, f"-keyboard.{name[1:]}" if name[0] == "-" else f"keyboard.{name}")
    assert [each.key for each in questions(a_study(tmp_path, keys))][:1] == ["operator"]
    operator = "{use: simulated_operator, axes: [keyboard.a, keyboard.b, keyboard.c, keyboard.e]"
    keys = keys.replace("machine:", f"operator: {operator}, button: keyboard.t}}\nmachine:")
    study = a_study(tmp_path, keys)
    assert questions(study) == ()
    moved = [
        [frame.state.tobytes() for frame in rehearse(each).frames]
        for each in (a_study(tmp_path, sticks), study)
    ]
    assert len(moved[0]) > 500
    assert moved[0] == moved[1]


# --- the parts


def test_a_sub_movement_is_the_one_of_least_jerk() -> None:
    settings = OperatorSettings(motor_noise=0.0, gain_per_s=1.0)
    own, way = Aimer(settings, Noise(1), 1.0, dt=0.4).own, np.array([2.0, 0.0, -1.0])
    own[law.PLANNED : law.DT] = (1.0, 4.0, 1.0, 2.0, 0.0, *way, 3.0, 2.0, -1.0)
    own[law.DOING], own[law.LEFT], own[law.STILL2] = law.MOVING, 12.0, 0.0
    for u in np.linspace(0, 1, 11):
        position = [1, 2, 0] + (10 * u**3 - 15 * u**4 + 6 * u**5) * way
        velocity = (30 * u**2 - 60 * u**3 + 30 * u**4) / 4.0 * way
        assert law.follow(own, *position) == law.GOES
        np.testing.assert_allclose(own[law.ASKED : law.DRAWN], velocity, atol=1e-13)
    assert law.follow(own, 3.0, 2.0, -1.0) == law.GOES
    assert own[law.ASKED : law.DRAWN] == [0.0, 0.0, 0.0]


def test_scatter_grows_with_distance_and_is_half_as_wide_to_the_sides() -> None:
    noise = Noise(1)
    for length in (1.0, 5.0):
        points = np.array([noise.scatter((0, 0, 0), (length, 0, 0), 0.1) for _ in range(4000)])
        np.testing.assert_allclose(points.mean(axis=0), [length, 0, 0], atol=0.01 * length)
        wanted = np.array([0.1, 0.05, 0.05]) * length
        np.testing.assert_allclose(points.std(axis=0), wanted, rtol=0.05)


def test_motor_noise_has_unit_variance_and_the_correlation_asked_for() -> None:
    aimer = Aimer(OperatorSettings(motor_noise_s=1.0), Noise(2), 1.0, dt=-math.log(0.8))
    values = []
    for _ in range(40_000):
        aimer.move((0.0, 0.0, 0.0), 1.0, (1.0, 0.0, 0.0), 0.25)
        values.append(aimer.own[law.NOISE : law.LEFT])
    drawn = np.unique(values, axis=0, return_index=True)[1]  # while the hands rest, none is drawn
    values = np.array(values)[np.sort(drawn)][100:]
    assert len(values) > 20_000
    np.testing.assert_allclose(values.std(axis=0), 1.0, rtol=0.05)
    for axis in values.T:
        assert np.corrcoef(axis[1:], axis[:-1])[0, 1] == pytest.approx(0.8, abs=0.02)


def test_reaction_times_are_lognormal_around_their_median() -> None:
    logs = np.log([Noise(seed).reaction(0.35, 0.2) for seed in range(2000)])
    assert math.exp(np.median(logs)) == pytest.approx(0.35, rel=0.02)
    assert logs.std() == pytest.approx(0.2, rel=0.06)


# --- the closed loop


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_targets_are_reached_from_rest_and_from_each_other(scheme: str) -> None:
    reached = []
    for seed in range(2):
        for distance in DISTANCES:
            for mirror in (-1, 1):
                loop = Loop(scheme)
                for number, target in enumerate(ends(distance, mirror), start=1):
                    done = loop.trial(target, 100 * seed + number, number)
                    reached.append(done.reached_s is not None)
    assert np.mean(reached) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("actuator", ACTUATOR_PRESETS)
def test_a_machine_that_follows_late_is_brought_in(actuator: str) -> None:
    reached = []
    for seed in range(3):
        loop = Loop(actuator=actuator)
        for number, target in enumerate(ends(4.0) * 2, start=1):
            reached.append(loop.trial(target, 10 * seed + number, number).reached_s is not None)
    assert all(reached)


def test_the_other_machine_is_operated_as_well() -> None:
    loop = Loop(machine=load_machine("ch8_cranelike"))
    for number, target in enumerate(ends(4.0), start=1):
        assert loop.trial(target, number, number).reached_s is not None


@pytest.mark.slow
def test_without_noise_movement_time_follows_fitts_law_exactly_as_set() -> None:
    a, b, reaction = 2.0, 4.0, 0.3
    steady = STEADY | {"fitts_a_s": a, "fitts_b_s": b, "reaction_s": reaction}
    found = times("joint_velocity", range(1), **steady)
    bits = [math.log2(distance / 0.5 + 1) for distance in found]
    slope, intercept = np.polyfit(bits, [mean[0] for mean in found.values()], 1)
    assert slope == pytest.approx(b, rel=0.1)
    assert intercept == pytest.approx(a + reaction + 0.2, abs=1.0)


def test_a_machine_that_is_too_slow_makes_the_movement_longer_and_is_still_brought_in() -> None:
    ch8_machine = ch8()
    slow = ch8_machine.model_copy(
        update={
            "joints": tuple(
                joint.model_copy(update={"speed_deg_s": joint.speed_deg_s / 6})
                for joint in ch8_machine.joints
            )
        }
    )
    near, far = ends(4.0)
    taken = []
    for machine in (ch8_machine, slow):
        loop = Loop("joint_velocity", STEADY, machine)
        loop.trial(near, limit_s=60)
        taken.append(loop.trial(far, limit_s=60).reached_s)
    assert taken[0] is not None
    assert taken[1] is not None
    assert taken[1] > 1.3 * taken[0]


@pytest.mark.slow
def test_practice_makes_later_trials_faster() -> None:
    near, far = ends(3.0)
    early, late = [], []
    for seed in range(6):
        for number, found in ((1, early), (30, late)):
            loop = Loop()
            loop.trial(near, seed, number)
            found.append(loop.trial(far, seed, number).reached_s)
    assert np.mean(late) < 0.85 * np.mean(early)


def test_participants_differ_by_their_seed_and_only_when_asked_to() -> None:
    paces = [Loop(settings={"pace_sd": 0.2}, participant_seed=n) for n in (1, 2, 1)]
    facts = [loop.operator.metadata()["pace"] for loop in paces]
    assert facts[0] == facts[2] != facts[1]
    assert Loop().operator.metadata()["pace"] == 1.0


# --- the same again


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_trial_run_again_has_the_same_axes_bit_for_bit(scheme: str) -> None:
    far = ends(3.0)[1]
    fresh = Loop(scheme).trial(far, seed=7)
    used = Loop(scheme)
    used.trial(ends(2.0)[0], seed=3)
    used.crane = IdealCrane(used.machine, used.machine.rest)
    again = used.trial(far, seed=7)
    np.testing.assert_array_equal(fresh.axes, again.axes)
    other = Loop(scheme).trial(far, seed=8)
    assert fresh.axes.shape != other.axes.shape or (fresh.axes != other.axes).any()


# --- hands


def test_hands_rest_without_a_target_and_until_the_reaction_is_over() -> None:
    loop = Loop(settings={"reaction_s": 0.5, "reaction_sd": 0.0})
    idle = loop.trial(None, limit_s=2)
    assert not idle.axes[:, [0, 1, 2, 3, 4, 6, 7, 8, 9, 10]].any()
    assert (idle.axes[:, [5, 11]] == 1.0).all(), "the sticks stay connected"
    done = loop.trial(ends(3.0)[0])
    assert done.first_push_s == pytest.approx(0.5, abs=3 / RATE_HZ)


def test_a_pause_rests_the_hands_and_shifts_the_plan() -> None:
    far = ends(3.0)[1]
    whole = Loop().trial(far, seed=5)
    pause = range(700, 1200)
    paused = Loop().trial(far, seed=5, pauses=(pause,))
    held = slice(pause.start + 1, pause.stop + 1)  # the hands see the frame before
    sticks = [0, 1, 6, 7]
    assert not paused.axes[held][:, sticks].any()
    assert paused.reached_s is not None
    assert whole.reached_s is not None
    assert paused.reached_s - whole.reached_s == pytest.approx(len(pause) / RATE_HZ, abs=0.1)


def test_the_trigger_is_pressed_once_at_rest_inside_the_target() -> None:
    target = ends(3.0)[1]
    loop = Loop()
    trial = loop.trial(target, seed=2, rest_s=3.0)
    pressed = trial.axes[:, 10] > 0.5
    edges = np.flatnonzero(np.diff(pressed.astype(int)) == 1) + 1
    assert len(edges) == 1
    assert math.dist(trial.path[edges[0]], target) <= RADIUS
    step = np.linalg.norm(trial.path[edges[0]] - trial.path[edges[0] - 1])
    assert step * RATE_HZ < 0.02
    assert pressed.sum() / RATE_HZ == pytest.approx(0.1, abs=2 / RATE_HZ)


def test_what_the_last_trial_left_on_view_is_not_aimed_at() -> None:
    loop = Loop(settings={"reaction_s": 0.01, "reaction_sd": 0.0})
    loop.operator.begin_trial(Trial(2, 1, 1, PlannedTrial({}, expected_s=1.0)))
    left = (*ends(3.0)[0], RADIUS)
    for number in range(50):
        stale = loop.show(number, left, phase=Phase.SUCCESS, trial=1)
        assert not loop.operator.read(stale.tick, stale)[:5].any()
    shown = [loop.show(number, left, trial=2) for number in range(20)]
    assert any(loop.operator.read(frame.tick, frame)[:2].any() for frame in shown)


def test_a_target_that_moves_is_reacted_to_anew() -> None:
    settings = OperatorSettings(reaction_s=0.1, reaction_sd=0.0)
    aimer = Aimer(settings, Noise(1), 1.0, 0.01)
    tip = (0.0, 0.0, 0.0)
    first = [aimer.move(tip, 0.0, (1.0, 0.0, 0.0), 0.25) for _ in range(50)]
    assert first[8] == (0.0, 0.0, 0.0)
    assert first[30][0] > 0.0
    second = [aimer.move(tip, 0.0, (-1.0, 0.0, 0.0), 0.25) for _ in range(50)]
    assert second[8] == (0.0, 0.0, 0.0)
    assert second[30][0] < 0.0
