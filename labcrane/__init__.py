"""labcrane: studies of people operating cranes and manipulators.

Everything a plugin needs is importable from here, and nothing else is public, except the contract
tests in ``labcrane.testing``.

A name is imported from its module when it is asked for the first time, so that ``labcrane --help``
loads none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from labcrane.actuator import PRESETS, Actuator, ActuatorSettings
    from labcrane.analysis.cohort import Participant
    from labcrane.clock import Tick
    from labcrane.errors import (
        DeviceError,
        LabcraneError,
        PluginError,
        ProtocolError,
        RecordingError,
    )
    from labcrane.finding import Finding, Verdict
    from labcrane.hookspecs import hookimpl
    from labcrane.kinematics import Arm, frames, jacobian
    from labcrane.machine import Body, Joint, Machine
    from labcrane.offers import Ask, CommandOffer, Offer, Settings, StudyPath, offer
    from labcrane.questions import AnswerError, Answers, Item, Score, numbers
    from labcrane.reachability import reach
    from labcrane.recording.recording import SessionRecord, Stream, open_recording
    from labcrane.recording.stream_header import Channel, StreamHeader
    from labcrane.recording.xdf import XdfWriter
    from labcrane.records import (
        Event,
        Frame,
        Judgement,
        Phase,
        Planned,
        Run,
        Situation,
        Trial,
        Value,
    )
    from labcrane.roles import (
        Controller,
        Cue,
        Dynamics,
        Exporter,
        Feedback,
        InputDevice,
        Questionnaire,
        Task,
    )
    from labcrane.scene import Form, Part, Placed, Scene, load_scene, place
    from labcrane.scene_text import SCENE_PLACED, read_placed, write_placed
    from labcrane.shapes import Ball, Beam, Shape, Targets
    from labcrane.signals import FloatArray, Layout, Signal, signals_of

__version__ = "0.1.0"

__all__ = [
    "PRESETS",
    "SCENE_PLACED",
    "Actuator",
    "ActuatorSettings",
    "AnswerError",
    "Answers",
    "Arm",
    "Ask",
    "Ball",
    "Beam",
    "Body",
    "Channel",
    "CommandOffer",
    "Controller",
    "Cue",
    "DeviceError",
    "Dynamics",
    "Event",
    "Exporter",
    "Feedback",
    "Finding",
    "FloatArray",
    "Form",
    "Frame",
    "InputDevice",
    "Item",
    "Joint",
    "Judgement",
    "LabcraneError",
    "Layout",
    "Machine",
    "Offer",
    "Part",
    "Participant",
    "Phase",
    "Placed",
    "Planned",
    "PluginError",
    "ProtocolError",
    "Questionnaire",
    "RecordingError",
    "Run",
    "Scene",
    "Score",
    "SessionRecord",
    "Settings",
    "Shape",
    "Signal",
    "Situation",
    "Stream",
    "StreamHeader",
    "StudyPath",
    "Targets",
    "Task",
    "Tick",
    "Trial",
    "Value",
    "Verdict",
    "XdfWriter",
    "frames",
    "hookimpl",
    "jacobian",
    "load_scene",
    "numbers",
    "offer",
    "open_recording",
    "place",
    "reach",
    "read_placed",
    "signals_of",
    "write_placed",
]

_HOMES = {
    "actuator": "PRESETS Actuator ActuatorSettings",
    "analysis.cohort": "Participant",
    "clock": "Tick",
    "errors": "DeviceError LabcraneError PluginError ProtocolError RecordingError",
    "finding": "Finding Verdict",
    "hookspecs": "hookimpl",
    "kinematics": "Arm frames jacobian",
    "machine": "Body Joint Machine",
    "offers": "Ask CommandOffer Offer Settings StudyPath offer",
    "questions": "AnswerError Answers Item Score numbers",
    "reachability": "reach",
    "recording.recording": "SessionRecord Stream open_recording",
    "recording.stream_header": "Channel StreamHeader",
    "recording.xdf": "XdfWriter",
    "records": "Event Frame Judgement Phase Planned Run Situation Trial Value",
    "roles": "Controller Cue Dynamics Exporter Feedback InputDevice Questionnaire Task",
    "scene": "Form Part Placed Scene load_scene place",
    "scene_text": "SCENE_PLACED read_placed write_placed",
    "shapes": "Ball Beam Shape Targets",
    "signals": "FloatArray Layout Signal signals_of",
}


def __getattr__(name: str) -> object:
    for module, names in _HOMES.items():
        if name in names.split():
            found: object = getattr(import_module(f"labcrane.{module}"), name)
            globals()[name] = found
            return found
    raise AttributeError(f"module 'labcrane' has no attribute {name!r}")
