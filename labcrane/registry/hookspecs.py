"""Every point at which a plugin can extend labcrane, and the table of the roles it can fill.

Hooks are called once, while a rig is being built, and return offers. Nothing here runs during a
tick. To implement one, decorate a function of the same name with ``labcrane.hookimpl`` in the
module your entry point names.

A role is a class in :mod:`labcrane.core.roles`, a hook and a row of :data:`ROLES`. What is offered,
found, checked, watched, scaffolded and documented follows from the row.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import pluggy

from labcrane.analysis.exporter import Exporter
from labcrane.core.roles import (
    Capture,
    Component,
    Controller,
    Cue,
    Dynamics,
    Estimate,
    Feedback,
    InputDevice,
    Questionnaire,
    SecondaryTask,
    SignalMonitor,
    Task,
    Trigger,
)
from labcrane.registry.offers import CommandOffer, Offer

PROJECT = "labcrane"
"""The entry-point group of plugins; groups below it say more of them: ``labcrane.commands``."""

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)
"""Marks a function of a plugin as the hook of its name; a decorator."""


@hookspec
def labcrane_inputs() -> Sequence[Offer[InputDevice]]:
    """Offer devices the operator moves."""
    raise NotImplementedError


@hookspec
def labcrane_controllers() -> Sequence[Offer[Controller]]:
    """Offer mappings from the operator's axes to machine commands."""
    raise NotImplementedError


@hookspec
def labcrane_dynamics() -> Sequence[Offer[Dynamics]]:
    """Offer machines to operate."""
    raise NotImplementedError


@hookspec
def labcrane_tasks() -> Sequence[Offer[Task]]:
    """Offer things for the operator to do."""
    raise NotImplementedError


@hookspec
def labcrane_secondary() -> Sequence[Offer[SecondaryTask]]:
    """Offer second tasks that run beside any task."""
    raise NotImplementedError


@hookspec
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    """Offer formats into which recordings can be exported."""
    raise NotImplementedError


@hookspec
def labcrane_questionnaires() -> Sequence[Offer[Questionnaire]]:
    """Offer questions for the participant."""
    raise NotImplementedError


@hookspec
def labcrane_monitors() -> Sequence[Offer[SignalMonitor]]:
    """Offer monitors that check whether the signal of a stream is alive."""
    raise NotImplementedError


@hookspec
def labcrane_estimates() -> Sequence[Offer[Estimate]]:
    """Offer estimates of values from streams while a session runs."""
    raise NotImplementedError


@hookspec
def labcrane_triggers() -> Sequence[Offer[Trigger]]:
    """Offer lines that signal events to other devices."""
    raise NotImplementedError


@hookspec
def labcrane_captures() -> Sequence[Offer[Capture]]:
    """Offer cameras, microphones and screens to be recorded."""
    raise NotImplementedError


@hookspec
def labcrane_cues() -> Sequence[Offer[Cue]]:
    """Offer things to be seen in every view."""
    raise NotImplementedError


@hookspec
def labcrane_feedback() -> Sequence[Offer[Feedback]]:
    """Offer views, sounds and other devices that present a session to people."""
    raise NotImplementedError


@hookspec
def labcrane_commands() -> Sequence[CommandOffer]:
    """Offer commands of the command line."""
    raise NotImplementedError


class Returned(Enum):
    """The value that a method that runs every tick must return."""

    NUMBERS = auto()
    """An array of what the component's signals promise, all of them numbers."""

    JUDGEMENT = auto()
    """A judgement, whose values are what the signals promise; NaN may be among them."""


@dataclass(frozen=True, slots=True)
class RoleEntry:
    """How a role is found, spoken of and watched.

    Attributes
    ----------
    hook
        The hook that collects its offers.
    word
        Its name for researchers.
    about
        What a plugin of it is, in words.
    keys
        Where a protocol uses it; none for what no protocol names. In a new plugin's protocol the
        last of single ones is used: what needs no hardware.
    several
        Whether its keys hold several components, by names of the study's own.
    step
        The step of a session that names one, if there is one.
    recorded
        When its signals are recorded.
    returns
        What its methods that run every tick return, by their names; with it every call of a
        method is watched. None where a component runs in a process of its own, or long after.
    """

    hook: Callable[[], Sequence[Offer[Any]]]
    word: str
    about: str
    keys: tuple[str, ...] = ()
    several: bool = False
    step: str = ""
    recorded: str = "every tick"
    returns: Mapping[str, Returned] | None = None


NUMBERS = Returned.NUMBERS
ROLES: Mapping[type[Component], RoleEntry] = {
    InputDevice: RoleEntry(
        labcrane_inputs,
        "input",
        "a device that the operator moves",
        ("input", "assist", "operator"),
        returns={"read": NUMBERS},
    ),
    Controller: RoleEntry(
        labcrane_controllers,
        "scheme",
        "a scheme, from the operator's axes to the machine's commands",
        ("scheme",),
        returns={"command": NUMBERS, "idle": NUMBERS},
    ),
    Dynamics: RoleEntry(
        labcrane_dynamics,
        "dynamics",
        "a machine to operate",
        ("dynamics",),
        returns={"state": NUMBERS, "step": NUMBERS},
    ),
    Task: RoleEntry(
        labcrane_tasks,
        "task",
        "a task for the operator",
        ("tasks",),
        several=True,
        returns={"evaluate": Returned.JUDGEMENT},
    ),
    SecondaryTask: RoleEntry(
        labcrane_secondary,
        "secondary",
        "a second task that runs beside any task",
        ("secondary",),
        several=True,
        returns={"evaluate": Returned.JUDGEMENT},
    ),
    Exporter: RoleEntry(labcrane_exporters, "exporter", "a format for recordings"),
    Questionnaire: RoleEntry(
        labcrane_questionnaires,
        "questionnaire",
        "questions for the participant",
        ("questionnaires",),
        several=True,
        step="questionnaire",
        returns={},
    ),
    SignalMonitor: RoleEntry(
        labcrane_monitors,
        "monitor",
        "a monitor of other programs' signals",
        ("monitors",),
        several=True,
    ),
    Estimate: RoleEntry(
        labcrane_estimates,
        "estimate",
        "values estimated from a stream while a session runs",
        ("estimates",),
        several=True,
    ),
    Trigger: RoleEntry(
        labcrane_triggers,
        "trigger",
        "a line that signals events to other devices",
        ("triggers",),
        several=True,
        returns={},
    ),
    Capture: RoleEntry(
        labcrane_captures,
        "capture",
        "a camera, microphone or screen to be recorded",
        ("recordings",),
        several=True,
        recorded="every frame in its files",
    ),
    Cue: RoleEntry(
        labcrane_cues,
        "cue",
        "something to be seen in every view",
        ("feedback",),
        several=True,
        recorded="every frame presented",
    ),
    Feedback: RoleEntry(
        labcrane_feedback,
        "feedback",
        "a device that presents the session",
        ("feedback", "views"),
        several=True,
        recorded="every frame presented",
    ),
}


def roles_by_key(*, several: bool) -> dict[str, tuple[type[Component], ...]]:
    """Return the roles that each key of a protocol takes, of keys for several or for one."""
    rows = [(role, entry) for role, entry in ROLES.items() if entry.several is several]
    keys = dict.fromkeys(key for _, entry in rows for key in entry.keys)
    return {key: tuple(role for role, entry in rows if key in entry.keys) for key in keys}


def role_called(name: str) -> type[Component] | None:
    """Return the role that researchers, or the public names, call ``name``."""
    for role, entry in ROLES.items():
        snake = re.sub(r"(?<!^)(?=[A-Z])", "_", role.__name__).lower()
        if name in {entry.word, snake}:
            return role
    return None
