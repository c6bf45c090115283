"""The public names of this package, and the modules from which they are imported."""

from .labels import HED_VERSION, LABELS, hed_sidecar, labelled, name_of
from .participant_file.about import citation
from .participant_file.reader import Recording, SessionRecord, Stream, open_recording
from .xdf.header import Channel, StreamHeader
from .xdf.writer import XdfWriter

__all__ = [
    "HED_VERSION",
    "LABELS",
    "Channel",
    "Recording",
    "SessionRecord",
    "Stream",
    "StreamHeader",
    "XdfWriter",
    "citation",
    "hed_sidecar",
    "labelled",
    "name_of",
    "open_recording",
]
