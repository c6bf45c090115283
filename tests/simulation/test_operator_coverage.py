"""How often the 95 % intervals of a fitted operator hold what went in: nightly, pytest -m soak."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from labcrane.cli.app import main
from labcrane_operator.fitting import fit_operator
from labcrane_operator.strokes import Strokes, read_strokes

WENT_IN = {
    "reaction_s": 0.35,
    "reaction_sd": 0.2,
    "fitts_a_s": 1.0,
    "fitts_b_s": 2.5,
    "learning_gain": 0.5,
    "learning_rate": 0.1,
    "endpoint_noise": 0.04,
}
"""The simulated operator's defaults."""

TO_SHOW = ("learning_rate", "fitts_b_s", "endpoint_noise")
MOVEMENTS = 32

STUDY = """\
labcrane: 1
study: coverage
title: The aiming study's movements, with a crane that follows at once
participants: {pattern: 'P\\d{3}', planned: 200}
rate_hz: 60
machine: ch8
input: {use: dual_joystick}
operator: {use: simulated_operator}
scheme:
  use: joint_velocity
  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
tasks:
  aiming: {use: aiming, distances: [2, 3, 4, 6], movements: 4}
design:
  order: {pairs: shuffled}
sessions:
  - {name: one, steps: [{block: {task: aiming}}]}
"""


def drawn(seed: int, spread: float) -> Strokes:
    """Draw strokes of the aiming study from the model's law, without a machine.

    ``spread`` is the standard deviation of the durations' logarithms: what the motor noise and the
    machine leave of them, or as much as people's differ from trial to trial.
    """
    random = np.random.default_rng(seed)
    trial = np.array([number for number in range(1, 41) if number % 5 != 1], float)
    distance = np.repeat(random.permutation([2, 2, 3, 3, 4, 4, 6, 6]), 4).astype(float)
    distance *= np.exp(0.02 * random.standard_normal(MOVEMENTS))
    width = np.full(MOVEMENTS, 0.5)
    duration = 1.0 + 2.5 * np.log2(distance / width + 1.0)
    duration *= 1.0 + 0.5 * np.exp(-0.1 * (trial - 1.0))
    duration *= np.exp(spread * random.standard_normal(MOVEMENTS))
    reaction = 0.35 * np.exp(0.2 * random.standard_normal(MOVEMENTS))
    miss = 0.04 * random.standard_normal((MOVEMENTS, 3)) * [1.0, 0.5, 0.5]
    return Strokes(trial, reaction, distance, width, duration, miss)


def coverage(sets: list[Strokes]) -> dict[str, float]:
    """Return by name how often the interval held what went in; a missing one does not hold it."""
    held = Counter[str]()
    for strokes in sets:
        for name, estimate in fit_operator(strokes).items():
            if name in WENT_IN and estimate.interval is not None:
                low, high = estimate.interval
                held[name] += low <= WENT_IN[name] <= high
    return {name: held[name] / len(sets) for name in WENT_IN}


@pytest.mark.soak
@pytest.mark.parametrize("spread", [0.005, 0.03, 0.1])
def test_intervals_hold_what_was_drawn_from_the_law(spread: float) -> None:
    found = coverage([drawn(seed, spread) for seed in range(600)])
    print(f"spread {spread:g}: {found}")  # noqa: T201 - with -s, what a night has found
    assert {name: 0.90 <= found[name] <= 0.98 for name in TO_SHOW} == dict.fromkeys(TO_SHOW, True)


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_intervals_hold_what_went_through_scheme_and_machine(tmp_path: Path) -> None:
    (tmp_path / "protocol.yaml").write_text(STUDY)
    data = tmp_path / "data"
    assert main(["simulate", str(tmp_path / "protocol.yaml"), "--out", str(data)]) == 0
    found = coverage([read_strokes(path, 1) for path in sorted(data.glob("P*/P*.h5"))])
    print(f"simulated: {found}")  # noqa: T201 - with -s, what a night has found
    assert {name: 0.90 <= found[name] <= 0.98 for name in TO_SHOW} == dict.fromkeys(TO_SHOW, True)
