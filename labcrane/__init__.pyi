"""The public names, and the modules from which they are imported."""

from . import (
    analysis,
    core,
    machines,
    participants,
    recording,
    registry,
    replay,
    streams,
    testing,
)
from .core.clock import Tick
from .core.records import Frame, Run, Trial
from .core.roles import (
    Capture,
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
    "Capture",
    "Controller",
    "Cue",
    "DeviceError",
    "Dynamics",
    "Estimate",
    "Feedback",
    "FloatArray",
    "Frame",
    "InputDevice",
    "LabcraneError",
    "Machine",
    "Offer",
    "PluginError",
    "ProtocolError",
    "Questionnaire",
    "RecordingError",
    "Run",
    "SecondaryTask",
    "Settings",
    "Signal",
    "SignalMonitor",
    "StreamError",
    "Task",
    "Tick",
    "Trial",
    "Trigger",
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
    "streams",
    "testing",
]
