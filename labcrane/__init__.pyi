"""The public names, and the modules from which they are imported."""

from .actuator import PRESETS, Actuator, ActuatorSettings
from .analysis.cohort import Participant
from .analysis.movements import Movement, movements
from .arrays import FloatArray
from .boxes import link_boxes
from .clock import Tick
from .errors import (
    DeviceError,
    LabcraneError,
    PluginError,
    ProtocolError,
    RecordingError,
)
from .finding import Finding, Verdict
from .hookspecs import hookimpl
from .kinematics import Arm, frames, jacobian
from .machine import Body, Joint, Machine
from .mesh_file import MeshFile
from .offers import Ask, CommandOffer, Offer, Settings, StudyPath, offer
from .questions import AnswerError, Answers, Item, Score, numbers
from .quiet_import import quietly_imported
from .reachability import reach
from .recording.recording import SessionRecord, Stream, open_recording
from .recording.stream_header import Channel, StreamHeader
from .recording.xdf import XdfWriter
from .records import (
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
from .roles import (
    Controller,
    Cue,
    Dynamics,
    Exporter,
    Feedback,
    InputDevice,
    Questionnaire,
    SignalMonitor,
    Task,
)
from .scene import Form, Part, Placed, Scene, load_scene, place
from .scene_text import SCENE_PLACED, read_placed, write_placed
from .shapes import Ball, Beam, Shape, Targets
from .signals import (
    Layout,
    Signal,
    SignalChannel,
    SignalFault,
    SignalStream,
    signals_of,
)
from .urdf_text import urdf, urdf_joint, urdf_link

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
    "SignalChannel",
    "SignalFault",
    "SignalMonitor",
    "SignalStream",
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
    "link_boxes",
    "load_scene",
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
