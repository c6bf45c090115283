"""Measures of one movement, against published values, closed forms and signals made by hand."""

import math

import numpy as np
import pytest

from labcrane.analysis.kinematics.smoothness import ldlj, path_ratio, sparc, sub_movements
from labcrane.analysis.sticks import coordination, effort, limit_hits, reversals, stick_use

RATE_HZ = 100.0
TIME = np.arange(-1.0, 1.0, 0.01)
BELL = np.exp(-5.0 * TIME**2)


def test_sparc_and_ldlj_are_those_published_for_the_reference_signal() -> None:
    """The signal and values of Balasubramanian's own implementation."""
    assert sparc(BELL, RATE_HZ) == pytest.approx(-1.41403, abs=5e-6)
    assert ldlj(BELL, RATE_HZ) == pytest.approx(-5.81636, abs=5e-6)


def test_a_minimum_jerk_movement_has_the_jerk_of_its_closed_form() -> None:
    s = np.linspace(0.0, 1.0, 20001)
    speed = 30.0 * s**2 * (1.0 - s) ** 2
    expected = -math.log(720.0 / 1.875**2)
    assert ldlj(speed, 20000.0) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("factor", [0.01, 7.0])
def test_smoothness_does_not_depend_on_the_unit_of_speed(factor: float) -> None:
    assert sparc(factor * BELL, RATE_HZ) == pytest.approx(sparc(BELL, RATE_HZ), rel=1e-12)
    assert ldlj(factor * BELL, RATE_HZ) == pytest.approx(ldlj(BELL, RATE_HZ), rel=1e-12)


def test_tremor_makes_a_movement_less_smooth() -> None:
    shaken = BELL * (1.0 + 0.2 * np.sin(2 * np.pi * 6.0 * TIME))
    assert sparc(shaken, RATE_HZ) < sparc(BELL, RATE_HZ)
    assert ldlj(shaken, RATE_HZ) < ldlj(BELL, RATE_HZ)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_sub_movements_are_the_bells_a_movement_is_made_of(count: int) -> None:
    speed = np.concatenate([BELL / (at + 1) for at in range(count)])
    rng = np.random.default_rng(1)
    assert sub_movements(speed + 0.01 * rng.standard_normal(len(speed)), RATE_HZ) == count


def test_a_half_circle_is_half_pi_times_its_diameter() -> None:
    angle = np.linspace(0.0, np.pi, 5001)
    arc = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    assert path_ratio(arc) == pytest.approx(np.pi / 2, rel=1e-6)
    assert math.isnan(path_ratio(np.zeros((5, 3))))


def test_a_sine_reverses_twice_a_period_and_its_noise_never() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    noise = 0.004 * np.random.default_rng(2).uniform(-1, 1, len(t))
    assert reversals(np.sin(2 * np.pi * t) + noise, 0.02) == 20
    assert reversals(noise, 0.02) == 0
    assert reversals(t / 10.0, 0.02) == 0


def test_stick_use_counts_axes_and_hands() -> None:
    on, off = np.ones(10), np.zeros(10)
    half = np.r_[np.ones(5), np.zeros(5)]
    use = stick_use({"left.x": on, "left.y": half, "right.x": half, "right.y": off}, 0.05)
    assert (use.simultaneous, use.axes, use.bimanual) == (0.5, 2.0, 0.5)
    still = stick_use({"left.x": off, "right.x": off}, 0.05)
    assert still.simultaneous == 0.0
    assert math.isnan(still.bimanual)


def test_the_lag_of_two_hands_is_found() -> None:
    left, right = np.exp(-40.0 * TIME**2), np.exp(-40.0 * (TIME - 0.12) ** 2)
    peak, lag = coordination(left, right, RATE_HZ)
    assert lag == pytest.approx(0.12)
    assert peak > 0.98
    assert all(map(math.isnan, coordination(left, np.ones(len(left)), RATE_HZ)))


def test_effort_is_the_share_of_full_speed() -> None:
    command = np.tile([0.5, -1.0], (7, 1))
    assert effort(command, np.array([1.0, 2.0])) == pytest.approx(0.5)


def test_a_limit_is_hit_once_however_long_a_joint_stays() -> None:
    limits = np.array([[-1.0, 1.0]])
    angles = np.array([[0.0], [1.0], [1.0], [0.5], [-1.0], [-1.0]])
    assert limit_hits(angles, limits, 0.001) == 2
