"""The public names, and the modules from which they are imported."""

from . import analysis, core, machines, participants, recording, registry, replay, testing
from .analysis.exporter import Exporter
from .core.clock import Tick
from .core.primitives import Cylinder, Sphere
from .core.records import Event, Frame, Phase, PlannedTrial, Run, Trial, TrialStatus
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
from .core.settings import Settings
from .core.signals import Signal
from .errors import (
    DeviceError,
    LabcraneError,
    PluginError,
    ProtocolError,
    RecordingError,
    StreamError,
)
from .machines.machine import Machine
from .recording.participant_file.reader import open_recording
from .registry.hookspecs import hookimpl
from .registry.offers import Offer, offer
from .types import FloatArray

__version__: str

__all__ = [
    "Controller",
    "Cue",
    "Cylinder",
    "DeviceError",
    "Dynamics",
    "Event",
    "Exporter",
    "Feedback",
    "FloatArray",
    "Frame",
    "InputDevice",
    "LabcraneError",
    "Machine",
    "Offer",
    "Phase",
    "PlannedTrial",
    "PluginError",
    "ProtocolError",
    "Questionnaire",
    "RecordingError",
    "Run",
    "Settings",
    "Signal",
    "SignalMonitor",
    "Sphere",
    "StreamError",
    "Task",
    "Tick",
    "Trial",
    "TrialStatus",
    "analysis",
    "core",
    "hookimpl",
    "machines",
    "offer",
    "open_recording",
    "participants",
    "recording",
    "registry",
    "replay",
    "testing",
]
