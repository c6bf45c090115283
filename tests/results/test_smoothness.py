"""Measures of one movement, against published values, closed forms and signals made by hand."""

import math

import numpy as np
import pytest

from labcrane.analysis.kinematics.smoothness import ldlj, low_pass, path_ratio, sparc, sub_movements
from labcrane.analysis.sticks import coordination, effort, limit_hits, reversals, stick_use

RATE_HZ = 100.0
TIME = np.arange(-1.0, 1.0, 0.01)
BELL = np.exp(-5.0 * TIME**2)


def along_x(speed: np.ndarray) -> np.ndarray:
    """Velocity of a movement along a line."""
    return np.column_stack([speed, 0.0 * speed, 0.0 * speed])


def test_sparc_and_ldlj_are_those_published_for_the_reference_signal() -> None:
    """The signal and values of Balasubramanian's own implementation.

    It takes 2 s for the time from the first sample to the last, which is 1.99.
    """
    assert sparc(BELL, RATE_HZ) == pytest.approx(-1.41403, abs=5e-6)
    published = -5.81636 + 3.0 * math.log(2.0 / 1.99)
    assert ldlj(along_x(BELL), RATE_HZ) == pytest.approx(published, abs=2e-3)


@pytest.mark.parametrize("rate_hz", [30.0, 100.0, 1000.0])
@pytest.mark.parametrize("seconds", [1.5, 3.0])
def test_a_minimum_jerk_movement_has_the_jerk_of_its_closed_form(
    rate_hz: float, seconds: float
) -> None:
    time = np.arange(0.0, seconds + 2.0, 1.0 / rate_hz)
    s = np.clip((time - 1.0) / seconds, 0.0, 1.0)
    velocity = along_x(30.0 * s**2 * (1.0 - s) ** 2 / seconds)
    span = slice(round(rate_hz), round((1.0 + seconds) * rate_hz) + 1)
    expected = -math.log(720.0 / 1.875**2)
    assert ldlj(velocity, rate_hz, span) == pytest.approx(expected, abs=0.1)


def test_jerk_is_of_the_vector_so_that_a_bend_is_less_smooth_than_a_line() -> None:
    """At an even speed v on a circle of radius r, jerk is v³ / r²: T³ / v² · v⁶ / r⁴ · T."""
    time = np.arange(0.0, 4.0 + 1e-9, 0.01)
    circle = np.column_stack([np.cos(2.0 * time), np.sin(2.0 * time), 0.0 * time])
    span = slice(100, 301)
    expected = -math.log(2.0**3 * 2.0 * 2.0**4)
    assert ldlj(circle, RATE_HZ, span) == pytest.approx(expected, abs=0.02)


def test_a_low_pass_has_its_minus_3_db_at_the_cutoff_it_names_and_no_delay() -> None:
    for rate_hz in (30.0, 100.0, 1000.0):
        time = np.arange(0.0, 10.0, 1.0 / rate_hz)
        inner = (time > 2.0) & (time < 8.0)
        for frequency in (1.0, 3.0, 6.0, 12.0):
            wave = np.sin(2.0 * np.pi * frequency * time)
            gain = 1.0 / (1.0 + (math.sqrt(2.0) - 1.0) * (frequency / 6.0) ** 4)
            if frequency < rate_hz / 2.0:
                smooth = low_pass(wave, rate_hz, 6.0)
                np.testing.assert_allclose(smooth[inner], gain * wave[inner], atol=2e-3)


def test_a_low_pass_above_half_of_the_rate_is_refused() -> None:
    with pytest.raises(ValueError, match=r"at 6 Hz needs more than 12 samples a second.* are 10;"):
        low_pass(BELL, 10.0, 6.0)


@pytest.mark.parametrize("factor", [0.01, 7.0])
def test_smoothness_does_not_depend_on_the_unit_of_speed(factor: float) -> None:
    bell = along_x(BELL)
    assert sparc(factor * BELL, RATE_HZ) == pytest.approx(sparc(BELL, RATE_HZ), rel=1e-12)
    assert ldlj(factor * bell, RATE_HZ) == pytest.approx(ldlj(bell, RATE_HZ), rel=1e-12)


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
    assert (use["simultaneous"], use["axes_used"], use["bimanual"]) == (0.5, 2.0, 0.5)
    still = stick_use({"left.x": off, "right.x": off}, 0.05)
    assert still["simultaneous"] == 0.0
    assert math.isnan(still["bimanual"])


def test_the_lag_of_two_hands_is_found() -> None:
    left, right = np.exp(-40.0 * TIME**2), np.exp(-40.0 * (TIME - 0.12) ** 2)
    peak, lag = coordination(left, right, RATE_HZ)
    assert lag == pytest.approx(0.12)
    assert peak > 0.98
    assert all(map(math.isnan, coordination(left, np.ones(len(left)), RATE_HZ)))


def test_a_lag_is_searched_only_as_far_as_one_hand_follows_the_other() -> None:
    left, right = np.exp(-40.0 * (TIME + 0.4) ** 2), np.exp(-40.0 * (TIME - 0.4) ** 2)
    assert coordination(left, right, RATE_HZ, 1.0)[1] == pytest.approx(0.8)
    peak, lag = coordination(left, right, RATE_HZ)
    assert abs(lag) <= 0.5
    assert peak < 0.3
    random = np.random.default_rng(5)
    hands = low_pass(random.normal(size=(2, 40, 600)).reshape(80, 600).T, RATE_HZ, 1.0)
    found = [
        [coordination(hands[:, k], hands[:, k + 40], RATE_HZ, most)[0] for k in range(40)]
        for most in (0.5, 6.0)
    ]
    near, anywhere = np.mean(found, axis=1)
    assert near < 0.8 * anywhere


def test_effort_is_the_share_of_full_speed() -> None:
    command = np.tile([0.5, -1.0], (7, 1))
    assert effort(command, np.array([1.0, 2.0])) == pytest.approx(0.5)


def test_a_limit_is_hit_once_however_long_a_joint_stays() -> None:
    limits = np.array([[-1.0, 1.0]])
    angles = np.array([[0.0], [1.0], [1.0], [0.5], [-1.0], [-1.0]])
    assert limit_hits(angles, limits, 0.001) == 2
