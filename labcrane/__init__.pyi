"""The public names, and the modules from which they are imported."""

from .analysis.codebook import codebook_of
from .analysis.cohort import Participant
from .analysis.exporter import Exporter
from .analysis.measures import measures_of
from .analysis.movements import Movement, movements
from .core.clock import Tick
from .core.findings import Finding, Verdict
from .core.items import AnswerError, Answers, Item, Score, numeric_answers
from .core.primitives import Cylinder, Shape, Sphere, TargetFinder
from .core.records import (
    CameraImage,
    Event,
    Frame,
    Phase,
    PlannedTrial,
    Run,
    SessionState,
    Trial,
    TrialStatus,
    Value,
)
from .core.roles import (
    Controller,
    Cue,
    Dynamics,
    Feedback,
    InputDevice,
    Questionnaire,
    SignalMonitor,
    Task,
)
from .core.settings import Settings, StudyPath
from .core.signals import (
    Layout,
    Signal,
    SignalChannel,
    SignalFault,
    SignalStream,
    signals_of,
)
from .errors import (
    DeviceError,
    LabcraneError,
    PluginError,
    ProtocolError,
    RecordingError,
)
from .files.yaml import read_yaml
from .machines.actuator import ACTUATOR_PRESETS, Actuator, ActuatorSettings
from .machines.inverse_kinematics import reach
from .machines.kinematics import Arm, jacobian, link_frames
from .machines.links import link_boxes
from .machines.machine import Body, Joint, Machine
from .machines.mesh import MeshFile
from .machines.scene import Geom, PlacedObject, Scene, ShapeKind, load_scene, place_objects
from .machines.scene_codec import SCENE_PLACED, read_placed, write_placed
from .machines.urdf import urdf, urdf_joint, urdf_link
from .recording.participant_file.reader import SessionRecord, Stream, open_recording
from .recording.xdf.header import Channel, StreamHeader
from .recording.xdf.writer import XdfWriter
from .registry.hookspecs import hookimpl
from .registry.offers import CommandOffer, Offer, Prompt, offer
from .registry.quiet_import import quietly_imported
from .types import FloatArray

__version__: str

__all__ = [
    "ACTUATOR_PRESETS",
    "SCENE_PLACED",
    "Actuator",
    "ActuatorSettings",
    "AnswerError",
    "Answers",
    "Arm",
    "Body",
    "CameraImage",
    "Channel",
    "CommandOffer",
    "Controller",
    "Cue",
    "Cylinder",
    "DeviceError",
    "Dynamics",
    "Event",
    "Exporter",
    "Feedback",
    "Finding",
    "FloatArray",
    "Frame",
    "Geom",
    "InputDevice",
    "Item",
    "Joint",
    "LabcraneError",
    "Layout",
    "Machine",
    "MeshFile",
    "Movement",
    "Offer",
    "Participant",
    "Phase",
    "PlacedObject",
    "PlannedTrial",
    "PluginError",
    "Prompt",
    "ProtocolError",
    "Questionnaire",
    "RecordingError",
    "Run",
    "Scene",
    "Score",
    "SessionRecord",
    "SessionState",
    "Settings",
    "Shape",
    "ShapeKind",
    "Signal",
    "SignalChannel",
    "SignalFault",
    "SignalMonitor",
    "SignalStream",
    "Sphere",
    "Stream",
    "StreamHeader",
    "StudyPath",
    "TargetFinder",
    "Task",
    "Tick",
    "Trial",
    "TrialStatus",
    "Value",
    "Verdict",
    "XdfWriter",
    "codebook_of",
    "hookimpl",
    "jacobian",
    "link_boxes",
    "link_frames",
    "load_scene",
    "measures_of",
    "movements",
    "numeric_answers",
    "offer",
    "open_recording",
    "place_objects",
    "quietly_imported",
    "reach",
    "read_placed",
    "read_yaml",
    "signals_of",
    "urdf",
    "urdf_joint",
    "urdf_link",
    "write_placed",
]
