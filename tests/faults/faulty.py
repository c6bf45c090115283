"""A plugin whose components do their work until one method, at one call, does not.

Copied into a study's plugins folder.
"""

import os
import time
from pathlib import Path

import numpy as np

from labcrane import Cue, Feedback, Questionnaire, Settings, Signal, hookimpl, offer
from labcrane.core import CraneSettings, Item, Sphere
from labcrane_aiming.aiming import Aiming
from labcrane_aiming.settings import AimingSettings
from labcrane_bullet.kinematic_crane import KinematicCrane
from labcrane_operator.operator import SimulatedOperator
from labcrane_operator.settings import OperatorSettings
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.settings import JointVelocitySettings

ORDER = Path(__file__).with_name("order.txt")
"""Role, method, number of the call, and what is to happen then."""


def spoil(role, component):
    wanted, method, at, how = ORDER.read_text().split()
    if wanted != role:
        return component
    good, calls = getattr(component, method), [0]

    def bad(*arguments):
        calls[0] += 1
        if calls[0] < int(at):
            return good(*arguments)
        return FAULTS[how](lambda: good(*arguments))

    setattr(component, method, bad)
    return component


def raising(good):
    raise ValueError("a mistake in a plugin")


def leaving(good):
    raise SystemExit("had enough")


def exiting(good):
    os._exit(7)


def hanging(good):
    time.sleep(3600)


def slow(good):
    time.sleep(0.05)
    return good()


def nan(good):
    values = good().copy()
    values[1] = np.nan
    return values


def short(good):
    return good()[:-1]


def judged_short(good):
    judgement = good()
    return type(judgement)(judgement.phase, judgement.values[:-1], judgement.events)


def nothing(good):
    return None


FAULTS = {
    name: globals()[name]
    for name in (
        "raising",
        "leaving",
        "exiting",
        "hanging",
        "slow",
        "nan",
        "short",
        "judged_short",
        "nothing",
    )
}


class Asked(Questionnaire):
    title, rights = "Asked", "our own"

    def items(self):
        return [Item("easy", "Easy?")]

    def score(self, answers):
        return {}


class Dot(Cue):
    signals = (Signal("one", "1"),)

    def draw(self, frame):
        return [Sphere("dot", (0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0, 1.0))]

    def values(self, frame):
        return np.ones(1)


class LampSettings(Settings):
    how: str = "fine"


class Lamp(Feedback):
    signals = (Signal("one", "1"), Signal("two", "1"))

    def __init__(self, settings):
        self._fault = FAULTS.get(settings.how, lambda good: good())
        self._seen = 0

    def present(self, frame):
        self._seen += 1
        return np.ones(2) if self._seen < 5 else self._fault(lambda: np.ones(2))


def offered(role, settings, build):
    return [offer(f"faulty_{role}", settings, lambda *given: spoil(role, build(*given)))]


@hookimpl
def labcrane_inputs():
    return offered("input", OperatorSettings, lambda settings, machine: SimulatedOperator(settings))


@hookimpl
def labcrane_controllers():
    return offered("scheme", JointVelocitySettings, JointVelocity)


@hookimpl
def labcrane_dynamics():
    return offered("dynamics", CraneSettings, KinematicCrane)


@hookimpl
def labcrane_tasks():
    return offered("task", AimingSettings, Aiming)


@hookimpl
def labcrane_questionnaires():
    return offered("questionnaire", Settings, lambda settings, machine: Asked())


@hookimpl
def labcrane_cues():
    return offered("cue", Settings, lambda settings, machine: Dot())


@hookimpl
def labcrane_feedback():
    return offered("feedback", LampSettings, lambda settings, machine: Lamp(settings))
