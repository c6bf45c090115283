"""The public names of this package, and the modules from which they are imported."""

from .participant_file.reader import Recording, SessionRecord, Stream, open_recording
from .xdf.header import Channel, StreamHeader
from .xdf.writer import XdfWriter

__all__ = [
    "Channel",
    "Recording",
    "SessionRecord",
    "Stream",
    "StreamHeader",
    "XdfWriter",
    "open_recording",
]
