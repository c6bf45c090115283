"""The public names of this package, and the modules from which they are imported."""

from .annotations import Annotation, annotate, read_annotations, withdraw
from .labels import (
    LABELS,
    attempt_of,
    hed_sidecar,
    labelled,
    void_attempts,
)
from .participant_file.about import citation
from .participant_file.reader import Recording, SessionRecord, Stream, open_recording
from .participant_file.writer import put_seal
from .pictures import LOG
from .xdf.header import Channel, StreamHeader
from .xdf.writer import XdfWriter

__all__ = [
    "LABELS",
    "LOG",
    "Annotation",
    "Channel",
    "Recording",
    "SessionRecord",
    "Stream",
    "StreamHeader",
    "XdfWriter",
    "annotate",
    "attempt_of",
    "citation",
    "hed_sidecar",
    "labelled",
    "open_recording",
    "put_seal",
    "read_annotations",
    "void_attempts",
    "withdraw",
]
