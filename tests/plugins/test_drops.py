"""Drops of a gripped thing, counted as somebody counts them who sees only where everything is."""

import math
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import RETRIEVAL, standing, step

from labcrane import FloatArray
from labcrane.machines import load_machine, load_scene, place_objects, reach
from labcrane.testing import RATE_HZ, make_run
from labcrane_scenario.observation import Observation
from labcrane_scenario.settings import ScenarioSettings

pytestmark = needs_bullet

SCENE = """\
labcrane_scene: 1
title: something to hold, and something to push it against
things:
  thing:
    {{shape: box, size: [0.08, 0.1, {tall}], position: [1.35, 0, {middle}], mass_kg: {mass},
      slip_n: {slip}, friction: {friction}}}
  wall: {{shape: box, size: [0.4, 0.2, 0.5], position: [1.35, 0.45, 0.25], fixed: true}}
goals: [{{position: [0, 0, 0], radius: 1}}]
"""
FALLING_M_S = 0.4
"""No joint of this arm lowers a thing as fast; what falls does after 8 mm."""

FALL_M = 0.1
BOUNCE_S = 0.5
"""What falls again this soon has only bounced or rolled over."""

Move = tuple[float, dict[str, float]]
"""For how many seconds, and with which signals."""


def falls(heights: FloatArray) -> int:
    """Return how often a thing fell, from its heights in m, a tick apart."""
    fast = np.diff(heights) * RATE_HZ < -FALLING_M_S
    ticks = np.flatnonzero(fast)
    if not len(ticks):
        return 0
    groups = np.split(ticks, np.flatnonzero(np.diff(ticks) > BOUNCE_S * RATE_HZ) + 1)
    return sum(heights[each[0]] - heights[each[-1] + 1] > FALL_M for each in groups)


@cache
def around(tall: float) -> list[float]:
    """Return a pose in rad whose jaws are around the thing, a little wider than it."""
    found = reach(load_machine("ied_arm.yaml", RETRIEVAL), (1.35, 0.0, 0.75 * tall))
    assert found is not None
    return [*found[:3], math.radians(32.0)]


def shown(folder: Path, random: np.random.Generator, moves: list[Move], **thing: float):
    """Grip a thing and move it; return drops counted, falls seen, and the states."""
    tall = float(random.uniform(0.16, 0.24))
    about = {
        "mass": random.uniform(2.0, 6.0),
        "slip": random.uniform(120.0, 350.0),
        "friction": random.uniform(0.3, 0.9),
        "tall": tall,
        "middle": 0.5 * tall + 1e-4,
    } | thing
    if share := about.pop("slip_of_weight", 0.0):
        about["slip"] = share * about["mass"] * 9.81
    with standing(SCENE.format(**about), folder) as (arm, state):
        settings = ScenarioSettings(scenes=(folder / "scene.yaml",))
        run = make_run(load_machine("ied_arm.yaml", RETRIEVAL), state=state.signals)
        watch = Observation(settings, run, place_objects(load_scene(settings.scenes[0]), 0))
        arm.reset(around(tall))
        states = []
        while not arm.state()[state.index("grip.thing")]:
            states.append(step(arm, 0.2, jaws=-150))
            assert len(states) < 20
        states.extend(step(arm, seconds, **signals) for seconds, signals in moves)
        ticks = np.concatenate(states)
    events = [event for values in ticks for event in watch.see(values, 0.0)]
    events += watch.end(ticks[-1], 0.0)
    drops = [event for event in events if event.name == "drop"]
    assert watch.mistakes.counts["drop"] == len(drops)
    assert all(event.data["thing"] == "thing" for event in drops)
    return drops, falls(ticks[:, state.index("scene.thing.position.z")])


AWAY: tuple[Move, ...] = ((2.0, {"jaws": 250.0}), (1.5, {"arm": -200.0}))
"""The jaws are opened and raised."""


def set_down(draw: Callable[[float, float], float]) -> Iterator[Move]:
    up = draw(0.5, 2.0)
    yield up, {"arm": -120.0}
    yield draw(0.0, 1.0), {"base": draw(-60.0, 0.0)}
    yield up + draw(0.5, 2.0), {"arm": 120.0}
    yield from AWAY


def press(draw: Callable[[float, float], float]) -> Iterator[Move]:
    for _ in range(3):
        yield draw(0.5, 1.0), {"arm": draw(60.0, 200.0), "jaws": draw(-200.0, 0.0)}
        yield draw(0.2, 0.8), {"arm": draw(-120.0, -60.0)}
    yield from AWAY


def push(draw: Callable[[float, float], float]) -> Iterator[Move]:
    yield draw(0.3, 1.5), {"arm": -100.0}
    yield draw(2.0, 4.0), {"base": draw(150.0, 250.0)}
    yield draw(0.5, 1.0), {"base": draw(-150.0, -60.0)}
    yield 2.5, {"arm": 100.0}
    yield from AWAY


def drag(draw: Callable[[float, float], float]) -> Iterator[Move]:
    for _ in range(3):
        yield draw(0.3, 1.0), {"base": draw(-150.0, 60.0), "boom": draw(-120.0, 120.0)}
    yield from AWAY


def let_fall(draw: Callable[[float, float], float]) -> Iterator[Move]:
    yield draw(3.5, 5.0), {"arm": -200.0}
    yield draw(0.0, 0.5), {}
    yield 2.0, {"jaws": draw(120.0, 250.0)}
    yield from AWAY


def lose(draw: Callable[[float, float], float]) -> Iterator[Move]:
    """Jerk what is hardly held."""
    yield 5.0, {"arm": -150.0}
    for _ in range(8):
        yield 0.25, {"base": -250.0}
        yield 0.25, {"base": 250.0}
    yield 3.0, {"jaws": -150.0}
    yield from AWAY


def throw(draw: Callable[[float, float], float]) -> Iterator[Move]:
    yield draw(3.5, 5.0), {"arm": -200.0}
    way = draw(-250.0, -150.0)
    yield draw(0.5, 1.5), {"base": way}
    yield draw(1.0, 2.0), {"base": way, "jaws": 250.0}
    yield from AWAY


@pytest.mark.parametrize(
    "drawn", [pytest.param(1, marks=pytest.mark.slow), pytest.param(50, marks=pytest.mark.long)]
)
@pytest.mark.parametrize(
    ("manoeuvre", "fall", "thing"),
    [
        (set_down, {0}, {}),
        (press, {0}, {}),
        (push, {0, 1}, {}),
        (drag, {0}, {}),
        (let_fall, {1}, {}),
        (lose, {1}, {"slip_of_weight": 1.2}),
        (throw, {1}, {}),
    ],
)
def test_drops_are_those_that_somebody_counts_who_sees_positions_only(
    manoeuvre: Callable[[Callable[[float, float], float]], Iterator[Move]],
    fall: set[int],
    thing: dict[str, float],
    drawn: int,
    tmp_path: Path,
) -> None:
    random = np.random.default_rng([drawn, *manoeuvre.__name__.encode()])
    wrong, seen = [], set()
    for number in range(drawn):
        moves = list(manoeuvre(lambda low, high: float(random.uniform(low, high))))
        drops, fallen = shown(tmp_path, random, moves, **thing)
        seen.add(fallen)
        if len(drops) != fallen:
            wrong.append((number, [dict(each.data) for each in drops], fallen, moves))
    assert not wrong
    assert seen <= fall
