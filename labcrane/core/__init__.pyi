"""The public names of this package, and the modules from which they are imported."""

from .crane import Crane
from .crane_settings import CraneSettings, GrappleSettings, LoadedCraneSettings
from .findings import Finding, Verdict
from .hanging import HangingLoad
from .items import AnswerError, Answers, Item, Score, numeric_answers
from .primitives import Shape, TargetFinder
from .records import CameraImage, SessionState, Value
from .settings import StudyPath, read_yaml
from .signals import Layout, SignalChannel, SignalFault, SignalStream, signals_of

__all__ = [
    "AnswerError",
    "Answers",
    "CameraImage",
    "Crane",
    "CraneSettings",
    "Finding",
    "GrappleSettings",
    "HangingLoad",
    "Item",
    "Layout",
    "LoadedCraneSettings",
    "Score",
    "SessionState",
    "Shape",
    "SignalChannel",
    "SignalFault",
    "SignalStream",
    "StudyPath",
    "TargetFinder",
    "Value",
    "Verdict",
    "numeric_answers",
    "read_yaml",
    "signals_of",
]
