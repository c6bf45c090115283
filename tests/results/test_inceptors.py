"""Inceptor measures against closed forms, from 30 to 1000 samples a second."""

import math

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report.report import _coarse_sticks
from labcrane.analysis.sticks import (
    inceptor_use,
    prediction_errors,
    resolution,
    steering_entropy,
    stick_rates,
)

RATES = pytest.mark.parametrize("rate_hz", [30.0, 100.0, 240.0, 1000.0])
SECONDS = 20.0


def times(rate_hz: float) -> np.ndarray:
    return np.arange(round(SECONDS * rate_hz)) / rate_hz


def used(rate_hz: float, *axes: np.ndarray) -> dict[str, float]:
    named = {f"left.{number}": axis for number, axis in enumerate(axes)}
    return inceptor_use(named, rate_hz, window_s=0.1, least_rate=0.1, highest_hz=10.0)


@RATES
@pytest.mark.parametrize("hz", [0.5, 1.3, 4.0])
def test_a_sine_has_its_power_its_frequency_and_its_rate(rate_hz: float, hz: float) -> None:
    found = used(rate_hz, 0.6 * np.sin(2 * np.pi * hz * times(rate_hz)))
    # A change over a window is the derivative times a sinc; linear interpolation between samples
    # adds up to 8 % of the square of phase per sample.
    sinc = np.sinc(hz * 0.1)
    coarse = (2 * np.pi * hz / rate_hz) ** 2 / 8
    assert found["stick_power"] == pytest.approx(0.18, rel=0.01)
    assert found["stick_centroid"] == pytest.approx(hz, rel=0.01)
    expected = 0.6 * 2 * np.pi * hz * sinc / math.sqrt(2)
    assert found["aggressiveness"] == pytest.approx(expected, rel=0.02 + coarse)


@RATES
def test_the_duty_cycle_of_a_sine_is_the_share_above_the_limit(rate_hz: float) -> None:
    found = used(rate_hz, 0.1 * np.sin(2 * np.pi * 0.25 * times(rate_hz)))
    peak = 0.1 * 2 * np.pi * 0.25 * np.sinc(0.025)
    assert found["duty_cycle"] == pytest.approx(1 - 2 / np.pi * math.asin(0.1 / peak), abs=0.02)


@RATES
def test_steps_move_for_the_window_only(rate_hz: float) -> None:
    axis = np.floor(times(rate_hz)) % 2  # a step every second, which takes one sample
    expected = 19 * (0.1 + 1 / rate_hz) / 20
    assert used(rate_hz, axis)["duty_cycle"] == pytest.approx(expected, abs=1 / rate_hz)


@RATES
def test_a_stick_at_rest_has_no_frequency(rate_hz: float) -> None:
    found = used(rate_hz, np.full(round(SECONDS * rate_hz), 0.3))
    assert (found["duty_cycle"], found["aggressiveness"]) == (0.0, 0.0)
    assert found["stick_power"] == pytest.approx(0.0, abs=1e-20)


@RATES
def test_noise_of_a_known_bandwidth_has_its_middle_as_centroid(rate_hz: float) -> None:
    random = np.random.default_rng(1)
    t, sines = times(rate_hz), np.arange(1.0, 5.0, 0.05)
    phases = random.uniform(0, 2 * np.pi, len(sines))
    axis = sum(0.05 * np.sin(2 * np.pi * f * t + p) for f, p in zip(sines, phases, strict=True))
    found = used(rate_hz, axis)
    assert found["stick_power"] == pytest.approx(len(sines) * 0.05**2 / 2, rel=0.15)
    assert found["stick_centroid"] == pytest.approx(2.975, rel=0.05)


def test_the_power_of_two_axes_adds_up() -> None:
    one = np.sin(2 * np.pi * times(240.0))
    assert used(240.0, one, one)["stick_power"] == pytest.approx(
        2 * used(240.0, one)["stick_power"]
    )


def test_too_few_samples_for_the_highest_frequency_give_no_spectrum() -> None:
    assert math.isnan(used(15.0, np.sin(times(15.0)))["stick_centroid"])


@RATES
def test_a_ramp_has_its_slope_everywhere(rate_hz: float) -> None:
    np.testing.assert_allclose(stick_rates(0.05 * times(rate_hz), rate_hz, 0.1), 0.05)


@RATES
def test_a_parabola_is_predicted_but_for_half_its_bend(rate_hz: float) -> None:
    # Of a t², the Taylor series from backward differences lacks half a second difference more.
    errors = prediction_errors(0.01 * times(rate_hz) ** 2, rate_hz)
    np.testing.assert_allclose(errors, 0.01 * 0.15**2, atol=0.01 / rate_hz**2)


def test_the_entropy_of_equal_shares_is_1_and_of_one_share_0() -> None:
    middles = np.array([-6.0, -3.0, -2.0, -0.7, 0.0, 0.7, 2.0, 3.0, 6.0])
    assert steering_entropy(np.repeat(middles, 10), 1.0) == pytest.approx(1.0)
    assert steering_entropy(np.zeros(50), 1.0) == 0.0
    assert math.isnan(steering_entropy(np.zeros(3), 1.0))


def test_the_entropy_of_normal_errors_is_that_of_its_bins() -> None:
    random = np.random.default_rng(2)
    errors = random.standard_normal(200_000)
    usual = 1.6448536  # 90 % of a normal distribution is within
    edges = np.array([-5.0, -2.5, -1.0, -0.5, 0.5, 1.0, 2.5, 5.0]) * usual
    below = np.array([0.5 * (1 + math.erf(edge / math.sqrt(2))) for edge in edges])
    shares = np.diff([0.0, *below, 1.0])
    shares = shares[shares > 0]
    expected = -(shares * np.log(shares)).sum() / math.log(9)
    assert steering_entropy(errors, usual) == pytest.approx(expected, abs=0.003)


@RATES
def test_steps_and_a_dead_zone_are_found_in_an_axis(rate_hz: float) -> None:
    axis = 0.6 * np.sin(2 * np.pi * 0.4 * times(rate_hz))
    coarse = np.round(axis / 0.05) * 0.05
    dead = np.where(np.abs(axis) < 0.1, 0.0, axis)
    assert resolution({"x": coarse})[0] == pytest.approx(0.05)
    assert 0.1 <= resolution({"x": dead})[1] < 0.1 + 0.6 * 2 * np.pi * 0.4 / rate_hz
    assert np.isnan(resolution({"x": np.zeros(10)})).all()


def test_the_report_warns_where_sampling_or_a_dead_zone_decides() -> None:
    fine = {"stick_step": 1e-4, "stick_least": 1e-4, "stick_centroid": 0.5}
    assert _coarse_sticks(pd.DataFrame([fine])) == ""
    odd = [{"stick_step": 0.05}, {"stick_least": 0.1}, {"stick_centroid": np.nan}]
    said = _coarse_sticks(pd.DataFrame([fine, *({**fine, **each} for each in odd)]))
    assert "In 1 of 4 movements a stick axis changes in steps larger than 0.01" in said
    assert "In 1 of 4 movements no deflection is smaller than 0.02" in said
    assert "In 1 of 4 movements the loop is too slow for 10 Hz" in said
