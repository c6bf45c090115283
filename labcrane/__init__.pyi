"""The public names, and the modules from which they are imported."""

from .analysis.codebook import codebook_of
from .analysis.cohort import Participant
from .analysis.exporter import Exporter
from .analysis.measures import measures_of
from .analysis.movements import Movement, movements
from .core.clock import Tick
from .core.findings import Finding, Verdict
from .core.items import AnswerError, Answers, Item, Score, numbers
from .core.primitives import Ball, Beam, Shape, Targets
from .core.records import (
    Event,
    Frame,
    Judgement,
    Phase,
    Picture,
    Planned,
    Run,
    Situation,
    Trial,
    Value,
)
from .core.roles import Controller, Cue, Dynamics, Feedback, InputDevice, Questionnaire, Task
from .core.settings import Settings, StudyPath
from .core.signals import Layout, Signal, signals_of
from .errors import (
    DeviceError,
    LabcraneError,
    PluginError,
    ProtocolError,
    RecordingError,
)
from .machines.actuator import PRESETS, Actuator, ActuatorSettings
from .machines.inverse_kinematics import reach
from .machines.kinematics import Arm, frames, jacobian
from .machines.links import link_boxes
from .machines.machine import Body, Joint, Machine
from .machines.mesh import MeshFile
from .machines.scene import Form, Part, Placed, Scene, load_scene, place
from .machines.scene_codec import SCENE_PLACED, read_placed, write_placed
from .machines.urdf import urdf, urdf_joint, urdf_link
from .recording.participant_file.reader import SessionRecord, Stream, open_recording
from .recording.xdf.header import Channel, StreamHeader
from .recording.xdf.writer import XdfWriter
from .registry.hookspecs import hookimpl
from .registry.offers import Ask, CommandOffer, Offer, offer
from .registry.quiet_import import quietly_imported
from .types import FloatArray

__version__: str

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
    "Movement",
    "Offer",
    "Part",
    "Participant",
    "Phase",
    "Picture",
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
    "codebook_of",
    "frames",
    "hookimpl",
    "jacobian",
    "link_boxes",
    "load_scene",
    "measures_of",
    "movements",
    "numbers",
    "offer",
    "open_recording",
    "place",
    "quietly_imported",
    "reach",
    "read_placed",
    "signals_of",
    "urdf",
    "urdf_joint",
    "urdf_link",
    "write_placed",
]
