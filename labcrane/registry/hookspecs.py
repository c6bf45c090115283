"""Every point at which a plugin can extend labcrane.

Hooks are called once, while a rig is being built, and return offers. Nothing here runs during a
tick. To implement one, decorate a function of the same name with ``labcrane.hookimpl`` in the
module your entry point names.
"""

from collections.abc import Sequence

import pluggy

from labcrane.analysis.exporter import Exporter
from labcrane.core.roles import (
    Controller,
    Cue,
    Dynamics,
    Feedback,
    InputDevice,
    Questionnaire,
    SignalMonitor,
    Task,
)
from labcrane.registry.entry_points import PROJECT
from labcrane.registry.offers import CommandOffer, Offer

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
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    """Offer formats into which recordings can be exported."""
    raise NotImplementedError


@hookspec
def labcrane_questionnaires() -> Sequence[Offer[Questionnaire]]:
    """Offer questions for the participant."""
    raise NotImplementedError


@hookspec
def labcrane_monitors() -> Sequence[Offer[SignalMonitor]]:
    """Offer monitors that tell whether the signal of a stream is alive."""
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
