"""labcrane: studies of people operating cranes and manipulators.

Everything a plugin needs is importable from here, and nothing else is public, except the contract
tests in ``labcrane.testing``.
"""

from labcrane.actuator import PRESETS, Actuator, ActuatorSettings
from labcrane.analysis.cohort import Participant
from labcrane.clock import Tick
from labcrane.errors import DeviceError, LabcraneError, PluginError, ProtocolError, RecordingError
from labcrane.finding import Finding, Verdict
from labcrane.hookspecs import hookimpl
from labcrane.kinematics import Arm, frames, jacobian
from labcrane.machine import Body, Joint, Machine
from labcrane.mesh_file import MeshFile
from labcrane.offers import Ask, CommandOffer, Offer, Settings, StudyPath, offer
from labcrane.questions import AnswerError, Answers, Item, Score, numbers
from labcrane.reach import reach
from labcrane.recording.recording import SessionRecord, Stream, open_recording
from labcrane.recording.stream_header import Channel, StreamHeader
from labcrane.recording.xdf import XdfWriter
from labcrane.records import Event, Frame, Judgement, Phase, Planned, Run, Situation, Trial, Value
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
    "MeshFile",
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
