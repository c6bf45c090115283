"""Cranes for tests: built as a rig builds them, opened, driven."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pytest
from needs import needs

from labcrane import Dynamics, FloatArray, Machine
from labcrane.testing import RATE_HZ, make_run
from labcrane_bullet import labcrane_dynamics as bullet_dynamics
from labcrane_mujoco import labcrane_dynamics as mujoco_dynamics

needs_bullet = needs("pybullet")
needs_mujoco = needs("mujoco")
ENGINES = [
    pytest.param("bullet_crane", marks=needs_bullet),
    pytest.param("mujoco_crane", marks=needs_mujoco),
]
CRANES = ["kinematic_crane", *ENGINES]
MACHINES = ["ch8", "ch8_cranelike"]
cranes = pytest.mark.parametrize("name", CRANES)
engines = pytest.mark.parametrize("name", ENGINES)
machines = pytest.mark.parametrize("model", MACHINES)
rates = pytest.mark.parametrize("rate_hz", [240.0, 1000.0])


def build(name: str, machine: Machine, actuator: object = "ideal", **hanging: object) -> Dynamics:
    """Return a crane as a rig builds it."""
    offers = (*bullet_dynamics(), *mujoco_dynamics())
    (offer,) = (offer for offer in offers if offer.name == name)
    settings = {"actuator": actuator, **hanging}
    return offer.build(offer.settings.model_validate(settings), machine)


@contextmanager
def standing(
    name: str,
    machine: Machine,
    rate_hz: float = RATE_HZ,
    actuator: object = "ideal",
    **hanging: object,
) -> Iterator[Dynamics]:
    """Yield an open crane at its pose of rest."""
    with closing(build(name, machine, actuator, **hanging)) as crane:
        crane.open(replace(make_run(machine), rate_hz=rate_hz))
        yield crane


def drive(crane: Dynamics, commands: FloatArray, rate_hz: float = RATE_HZ) -> FloatArray:
    """Return the state after every command, shape ``(n_ticks, n_state)``."""
    return np.array([crane.step(command, 1 / rate_hz).copy() for command in commands])


def random_poses(machine: Machine, count: int, seed: int = 1) -> FloatArray:
    lowest, highest = np.array(machine.limits).T
    return np.random.default_rng(seed).uniform(lowest, highest, (count, len(lowest)))


def random_sticks(machine: Machine, rate_hz: float, seconds: float, seed: int = 1) -> FloatArray:
    """Return smooth random commands around zero, up to about half of full speed."""
    random = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    pushes = np.zeros((len(time), len(machine.joints)))
    for _ in range(4):
        hertz, phase = random.uniform(0.1, 0.6, pushes.shape[1]), random.uniform(0, 6, 4)
        pushes += 0.2 * np.sin(2 * np.pi * np.outer(time, hertz) + phase)
    rise = np.minimum(1.0, time / 0.5)[:, None]  # from rest, so that no motor is overpowered
    return pushes * rise * machine.speeds
