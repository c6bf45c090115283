"""Measures of made movements whose truth is known: joint after joint, with halts and with noise."""

import numpy as np
import pytest
from made_movements import FINE_HZ, RATES_HZ, Made, drawn

from labcrane.analysis.kinematics.halts import halts
from labcrane.analysis.kinematics.smoothness import ldlj, low_pass, path_ratio
from labcrane_aiming.movement import AimedMovement
from labcrane_aiming.settings import AimingSettings

NOISE_M = (0.0, 1e-4, 5e-4, 1e-3, 2e-3)
HOLD_S = 0.1


class Seen:
    """A made movement as sensors see it, and as the task judges it until the end of its rest."""

    def __init__(self, movement: Made, rate_hz: float, noise_m: float, random) -> None:
        self.time = movement.sampled(rate_hz)
        tip = movement.tip(self.time)
        if noise_m:
            tip += random.normal(0.0, noise_m, tip.shape)
        self.tip = low_pass(tip, rate_hz, 6.0)
        velocity = np.gradient(self.tip, 1.0 / rate_hz, axis=0)
        self.speed = np.linalg.norm(velocity, axis=1)
        at_rest = self.speed[self.time < movement.before - 0.15]
        # Above what the sensors tell of a tip at rest.
        self.threshold = max(0.02, 4.0 * float(np.sqrt((at_rest**2).mean())))
        settings = AimingSettings(onset_speed=self.threshold, onset_hold_s=HOLD_S, end="trigger")
        far = (20.0, 0.0, 0.0)
        self.aimed = AimedMovement(settings, (0.0, 0.0, 0.0), far)
        rows = zip(self.time.tolist(), tip.tolist(), velocity.tolist(), strict=True)
        for time, at, speed in rows:
            self.aimed.see(time, time, at, speed)
        self.results = self.aimed.measures(len(self.time) - 1)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("halting", [True, False])
def test_onset_and_movement_time_are_true_at_every_rate_with_noise_halts_and_tremor(
    rate_hz: float, *, halting: bool
) -> None:
    for random, movement in drawn(round(rate_hz), 12, halting=halting):
        seen = Seen(movement, rate_hz, float(random.choice(NOISE_M)), random)
        onset = movement.still(seen.threshold)[0, 1]
        whole = seen.time[-1] - onset
        bound = 1.0 / rate_hz + 0.06  # the filter spreads a sudden beginning
        assert abs(seen.results["movement_time"] - whole) < bound
        assert abs(seen.results["movement_onset"] - onset) < bound


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_halts_are_those_that_were_made_however_noisy_the_sensors(rate_hz: float) -> None:
    made_halts = 0
    for random, movement in drawn(round(rate_hz) + 1, 12):
        seen = Seen(movement, rate_hz, float(random.choice(NOISE_M)), random)
        first = int(np.searchsorted(seen.time, seen.results["movement_onset"] - 1e-9))
        found = halts(
            seen.time[first:], seen.speed[first:], threshold=seen.threshold, hold_s=HOLD_S
        )
        between = movement.still(seen.threshold)[1:-1]
        lasted = between[:, 1] - between[:, 0]
        # A halt about as long as the hold may be one or none.
        surely, maybe = lasted[lasted > HOLD_S + 0.06], lasted[lasted > HOLD_S - 0.06]
        slack = (1.0 / rate_hz + 0.03) * max(len(maybe), 1)
        assert len(surely) <= found["halts"] <= len(maybe)
        assert surely.sum() - slack < found["halt_time"] < maybe.sum() + slack
        assert 0.0 < found["main_stroke_time"] < seen.results["movement_time"]
        made_halts += len(surely)
    assert made_halts > 10


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_noise_of_the_sensors_adds_four_percent_to_a_way_at_most(rate_hz: float) -> None:
    for random, movement in drawn(round(rate_hz) + 2, 8):
        seen = Seen(movement, rate_hz, float(random.choice(NOISE_M)), random)
        fine = movement.tip(np.arange(seen.time[0], seen.time[-1], 1e-3))
        assert path_ratio(seen.tip) / path_ratio(fine) == pytest.approx(1.015, abs=0.025)


def test_one_stroke_without_a_halt_is_its_own_main_stroke() -> None:
    time = np.arange(0.0, 1.0, 0.01)
    found = halts(time, np.full(100, 0.5), threshold=0.02, hold_s=0.1)
    assert (found["halts"], found["halt_time"]) == (0, 0.0)
    assert found["main_stroke_time"] == pytest.approx(0.99)


def test_halts_and_strokes_are_counted_to_the_sample() -> None:
    time = np.arange(0.0, 3.0, 0.1)
    speed = np.zeros(30)
    speed[0:5] = 0.3  # a stroke, to 0.5 s
    speed[8:16] = 0.9  # the fastest, from 0.8 to 1.6 s
    speed[12] = 0.0  # a tick that is no halt
    speed[18] = 0.4  # a tick that is no stroke
    speed[22:26] = 0.2  # the last, from 2.2 to 2.6 s; then rest
    found = halts(time, speed, threshold=0.02, hold_s=0.2)
    assert found["halts"] == 2
    assert found["halt_time"] == pytest.approx(0.3 + 0.6)
    assert found["main_stroke_time"] == pytest.approx(0.8)


@pytest.mark.parametrize("halting", [True, False])
def test_jerk_is_the_same_at_every_sampling_rate(*, halting: bool) -> None:
    for _, movement in drawn(3, 10, halting=halting):
        found = []
        for rate_hz in RATES_HZ:
            time, half = movement.sampled(rate_hz), 0.5 / FINE_HZ
            velocity = (movement.tip(time + half) - movement.tip(time - half)) * FINE_HZ
            edges = np.searchsorted(time, [movement.before, movement.ends])
            found.append(ldlj(velocity, rate_hz, slice(edges[0], edges[1] + 1)))
        assert max(found) - min(found) < 0.15
