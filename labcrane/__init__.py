"""labcrane: studies of people operating cranes and manipulators.

Everything a plugin needs is importable from here, and nothing else is public, except the contract
tests in ``labcrane.testing``.
"""

from labcrane.actuator import PRESETS, Actuator, ActuatorSettings
from labcrane.analysis.cohort import Participant
from labcrane.clock import Tick
from labcrane.errors import DeviceError, LabcraneError, PluginError, ProtocolError, RecordingError
from labcrane.hookspecs import hookimpl
from labcrane.kinematics import Arm, frames, jacobian
from labcrane.machine import Body, Joint, Machine
from labcrane.offers import CommandOffer, Offer, Settings, StudyPath, offer
from labcrane.reach import reach
from labcrane.recording.recording import SessionRecord, Stream, open_recording
from labcrane.recording.stream_header import Channel, StreamHeader
from labcrane.recording.xdf import XdfWriter
from labcrane.records import Event, Frame, Judgement, Phase, Planned, Run, Trial, Value
from labcrane.roles import Controller, Dynamics, Exporter, InputDevice, Task
from labcrane.scene import Placed, Scene, Shape, load_scene, place
from labcrane.signals import FloatArray, Layout, Signal

__version__ = "0.1.0"

__all__ = [
    "PRESETS",
    "Actuator",
    "ActuatorSettings",
    "Arm",
    "Body",
    "Channel",
    "CommandOffer",
    "Controller",
    "DeviceError",
    "Dynamics",
    "Event",
    "Exporter",
    "FloatArray",
    "Frame",
    "InputDevice",
    "Joint",
    "Judgement",
    "LabcraneError",
    "Layout",
    "Machine",
    "Offer",
    "Participant",
    "Phase",
    "Placed",
    "Planned",
    "PluginError",
    "ProtocolError",
    "RecordingError",
    "Run",
    "Scene",
    "SessionRecord",
    "Settings",
    "Shape",
    "Signal",
    "Stream",
    "StreamHeader",
    "StudyPath",
    "Task",
    "Tick",
    "Trial",
    "Value",
    "XdfWriter",
    "frames",
    "hookimpl",
    "jacobian",
    "load_scene",
    "offer",
    "open_recording",
    "place",
    "reach",
]
