"""The public names of this package, and the modules from which they are imported."""

from . import compiled, twin
from .crane import Crane
from .crane_settings import CraneSettings, GrappleSettings, LoadedCraneSettings
from .findings import Finding, Verdict
from .hanging import LoadedCrane
from .items import AnswerError, Answers, Item, Score, numeric_answers
from .primitives import Cylinder, Shape, Sphere, TargetFinder
from .records import (
    CameraImage,
    Echo,
    Event,
    Phase,
    PlannedTrial,
    SessionState,
    TrialStatus,
    Value,
)
from .references import (
    AxisName,
    ButtonName,
    CameraName,
    Covers,
    EventName,
    JointName,
    LinkName,
    Once,
    Preset,
    Reference,
    SceneObject,
    SignalName,
    ViewName,
)
from .settings import AtMost, Names, SceneFile, StudyPath, Unit, read_csv_text, read_yaml, was_run
from .signals import Layout, SignalChannel, SignalFault, SignalStream, signals_of
from .twin import Places, Twin

__all__ = [
    "AnswerError",
    "Answers",
    "AtMost",
    "AxisName",
    "ButtonName",
    "CameraImage",
    "CameraName",
    "Covers",
    "Crane",
    "CraneSettings",
    "Cylinder",
    "Echo",
    "Event",
    "EventName",
    "Finding",
    "GrappleSettings",
    "Item",
    "JointName",
    "Layout",
    "LinkName",
    "LoadedCrane",
    "LoadedCraneSettings",
    "Names",
    "Once",
    "Phase",
    "Places",
    "PlannedTrial",
    "Preset",
    "Reference",
    "SceneFile",
    "SceneObject",
    "Score",
    "SessionState",
    "Shape",
    "SignalChannel",
    "SignalFault",
    "SignalName",
    "SignalStream",
    "Sphere",
    "StudyPath",
    "TargetFinder",
    "TrialStatus",
    "Twin",
    "Unit",
    "Value",
    "Verdict",
    "ViewName",
    "compiled",
    "numeric_answers",
    "read_csv_text",
    "read_yaml",
    "signals_of",
    "twin",
    "was_run",
]
