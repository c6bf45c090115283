"""A simulated operator that errs: as often as it is told to, the same with the same seeds."""

import math

import numpy as np
import pytest

from labcrane_scenario.lapses import Lapses
from labcrane_scenario.settings import ErrorSettings

RATE_HZ = 240.0


@pytest.fixture(params=range(3))
def random(request) -> np.random.Generator:
    return np.random.default_rng(request.param)


def bumps(lapses: Lapses, seconds: float) -> int:
    """Return how often it begins to sink."""
    sinking = [lapses.sinks() > 0.0 for _ in range(round(seconds * RATE_HZ))]
    return sum(now and not before for before, now in zip([False, *sinking], sinking, strict=False))


def test_bumps_come_at_their_rate(random: np.random.Generator) -> None:
    rate, length = random.uniform(1.0, 6.0), 0.5
    settings = ErrorSettings(bumps_per_min=rate, bump_s=length, bump_m_s=0.2)
    minutes = 60
    found = bumps(Lapses(settings, RATE_HZ, (1, int(random.integers(1000)))), 60.0 * minutes)
    # While one lasts no other begins.
    expected = minutes * rate / (1.0 + rate / 60.0 * length)
    assert abs(found - expected) < 4.0 * math.sqrt(expected)


def test_a_grip_is_pressed_on_with_its_probability_and_once(random: np.random.Generator) -> None:
    share = random.uniform(0.2, 0.8)
    settings = ErrorSettings(over_grip=share, over_grip_s=0.1)
    lapses = Lapses(settings, RATE_HZ, (2, int(random.integers(1000))))
    pressed = []
    for _ in range(600):
        held = [lapses.presses_on(held=True) for _ in range(60)]
        pressed.append(sum(held))
        assert not lapses.presses_on(held=False)
    assert set(pressed) == {0, round(0.1 * RATE_HZ)}
    often = sum(map(bool, pressed))
    assert abs(often - 600 * share) < 4.0 * math.sqrt(600 * share * (1 - share))


def test_deformities_are_overlooked_and_imagined_with_their_probabilities() -> None:
    settings = ErrorSettings(misses=0.3, false_reports=0.1)
    drawn = [Lapses(settings, RATE_HZ, (5, seed)) for seed in range(2000)]
    for share, often in (
        (0.3, sum(each.overlooks for each in drawn)),
        (0.1, sum(each.imagines for each in drawn)),
    ):
        assert abs(often - 2000 * share) < 4.0 * math.sqrt(2000 * share * (1.0 - share))


def test_the_same_seeds_give_the_same_lapses_and_others_do_not() -> None:
    settings = ErrorSettings(bumps_per_min=20.0)

    def drawn(*seeds: int) -> list[float]:
        lapses = Lapses(settings, RATE_HZ, seeds)
        return [lapses.sinks() for _ in range(4800)]

    assert drawn(1, 2) == drawn(1, 2)
    assert drawn(1, 2) != drawn(1, 3)
    assert drawn(1, 2) != drawn(2, 2)
