"""Dead time, lag and rate limit against their closed forms."""

import math

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from labcrane.core.cranes.actuator import Actuator
from labcrane.machines import ACTUATOR_PRESETS, ActuatorSettings
from labcrane.testing import RATE_HZ

FULL = (0.5, 0.25)
RATES = pytest.mark.parametrize("rate_hz", [RATE_HZ, 1000.0])


class Drive(BaseModel):
    actuator: ActuatorSettings


def step_response(settings: ActuatorSettings, rate_hz: float, seconds: float) -> np.ndarray:
    """Return the speeds at the end of every tick after full speed is asked of two joints."""
    actuator = Actuator(settings, FULL, 1 / rate_hz)
    return np.array([actuator.follow(FULL) for _ in range(round(seconds * rate_hz))])


@RATES
def test_a_lag_answers_a_step_with_an_exponential(rate_hz: float) -> None:
    speeds = step_response(ActuatorSettings(lag_s=0.15), rate_hz, 1.0)
    time = np.arange(1, len(speeds) + 1) / rate_hz
    expected = np.outer(1 - np.exp(-time / 0.15), FULL)
    np.testing.assert_allclose(speeds, expected, rtol=0, atol=1e-13)


@RATES
def test_a_rate_limit_answers_a_step_with_a_ramp(rate_hz: float) -> None:
    speeds = step_response(ActuatorSettings(rate_limit=4.0), rate_hz, 1.0)
    time = np.arange(1, len(speeds) + 1) / rate_hz
    expected = np.outer(np.minimum(1.0, 4.0 * time), FULL)
    np.testing.assert_allclose(speeds, expected, rtol=0, atol=1e-13)


@RATES
def test_a_dead_time_moves_the_answer_and_changes_nothing_else(rate_hz: float) -> None:
    prompt = step_response(ActuatorSettings(lag_s=0.1), rate_hz, 1.0)
    late = step_response(ActuatorSettings(lag_s=0.1, dead_time_s=0.2), rate_hz, 1.0)
    delay = round(0.2 * rate_hz)
    assert not late[:delay].any()
    np.testing.assert_array_equal(late[delay:], prompt[:-delay])


def test_a_dead_time_is_rounded_to_whole_ticks() -> None:
    for dead_time_s, ticks in ((0.0, 0), (0.4 / 240, 0), (0.6 / 240, 1), (0.06, 14)):
        speeds = step_response(ActuatorSettings(dead_time_s=dead_time_s), 240.0, 0.1)
        assert np.count_nonzero(speeds[:, 0] == 0.0) == ticks


def test_a_lag_under_a_rate_limit_ramps_until_the_lag_is_slower() -> None:
    # A first-order lag with bounded slope r is a ramp until the distance left is r * lag, and an
    # exponential from there; the discrete one differs by less than what it moves in one tick.
    lag, rate, rate_hz = 0.15, 4.0, 10_000.0
    speeds = step_response(ActuatorSettings(lag_s=lag, rate_limit=rate), rate_hz, 1.0)[:, 0]
    time = np.arange(1, len(speeds) + 1) / rate_hz
    corner = (1 - rate * lag) / rate
    expected = np.where(time < corner, rate * time, 1 - rate * lag * np.exp(-(time - corner) / lag))
    np.testing.assert_allclose(speeds / FULL[0], expected, rtol=0, atol=rate / rate_hz)


def test_commands_that_change_afterwards_are_remembered_as_they_were() -> None:
    actuator = Actuator(ActuatorSettings(dead_time_s=2 / 240), FULL, 1 / 240)
    command = [0.0, 0.0]
    speeds = []
    for number in range(6):
        command[0] = float(number)
        speeds.append(actuator.follow(command)[0])
    assert speeds == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


def test_a_reset_actuator_answers_as_a_new_one() -> None:
    actuator = Actuator(ACTUATOR_PRESETS["sluggish"], FULL, 1 / 240)
    first = [actuator.follow(FULL) for _ in range(200)]
    actuator.reset()
    assert [actuator.follow(FULL) for _ in range(200)] == first


def test_an_ideal_actuator_gives_what_it_is_given() -> None:
    assert Actuator(ACTUATOR_PRESETS["ideal"], FULL, 1 / 240).follow((0.1, -0.2)) == (0.1, -0.2)


@pytest.mark.parametrize("name", ACTUATOR_PRESETS)
def test_every_preset_reaches_its_command(name: str) -> None:
    speeds = step_response(ACTUATOR_PRESETS[name], 240.0, 8.0)
    np.testing.assert_allclose(speeds[-1], FULL, rtol=1e-6)
    assert math.isclose(speeds.max(), FULL[0], rel_tol=1e-6), "it must not overshoot"


def test_settings_are_a_name_or_written_out() -> None:
    assert Drive.model_validate({"actuator": "hydraulic"}).actuator == ACTUATOR_PRESETS["hydraulic"]
    written = Drive.model_validate({"actuator": {"lag_s": 0.3}}).actuator
    assert written == ActuatorSettings(dead_time_s=0.0, lag_s=0.3, rate_limit=None)
    assert Drive.model_validate({"actuator": written}).actuator == written


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("hydralic", "no actuator is called 'hydralic'; did you mean 'hydraulic'?"),
        ("x", "no actuator is called 'x'; there is ideal, electric, hydraulic, sluggish"),
        (
            3,
            "3 is not an actuator; write a name (ideal, electric, hydraulic, sluggish) or a "
            "mapping of dead_time_s, lag_s, rate_limit",
        ),
    ],
)
def test_what_is_no_actuator_is_refused_with_what_there_is(value: object, message: str) -> None:
    with pytest.raises(ValidationError) as refusal:
        Drive.model_validate({"actuator": value})
    (error,) = refusal.value.errors()
    assert error["loc"] == ("actuator",)
    assert error["msg"] == f"Value error, {message}"


@pytest.mark.parametrize(
    "delays", [{"lag_s": -0.1}, {"dead_time_s": math.inf}, {"rate_limit": 0.0}, {"lag": 0.1}]
)
def test_impossible_delays_are_refused(delays: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        ActuatorSettings(**delays)
