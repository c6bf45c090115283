"""Configuration of a recording's process, and the name of its stream."""

from dataclasses import dataclass
from pathlib import Path

from labcrane.recording.pictures import CAPTURED
from labcrane.streams.outlets import source_id


@dataclass(frozen=True, slots=True)
class CaptureConfig:
    """What a recording's process is to do.

    Attributes
    ----------
    study, recorded
        The protocol, and whether it is read as the record of what was run.
    name
        The protocol's name for the recording.
    source
        The session (:attr:`labcrane.session.visit.Visit.source`).
    journal
        The first part of the session's journal; files are next to it.
    """

    study: Path
    recorded: bool
    name: str
    source: str
    journal: Path

    @property
    def stream(self) -> str:
        """Name of the stream that lists its frames."""
        return CAPTURED + self.name

    @property
    def stream_source(self) -> str:
        """That stream's source id, which is known before it exists."""
        return source_id(self.source, self.stream)
