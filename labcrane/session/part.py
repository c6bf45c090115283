"""A part of a visit that has a process of its own: a recording or an estimate."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.protocol.study import Study, load
from labcrane.registry.registry import discover

if TYPE_CHECKING:
    from labcrane.session.visit import Visit


@dataclass(frozen=True, slots=True)
class PartConfig:
    """What the process of a part is to do.

    Attributes
    ----------
    protocol, recorded
        The protocol, and whether it is read as the record of what was run.
    name
        The protocol's name for the part.
    source
        The session (:attr:`labcrane.session.visit.Visit.source`).
    journal
        The first part of the session's journal; files are next to it.
    """

    protocol: Path
    recorded: bool
    name: str
    source: str
    journal: Path

    @classmethod
    def of(cls, visit: "Visit", name: str) -> "PartConfig":
        """Return the configuration of a part of a visit."""
        study = visit.study
        return cls(study.path.resolve(), study.recorded, name, visit.source, visit.journal)

    def load(self) -> Study:
        """Return the study."""
        return load(self.protocol, discover(study=self.protocol), recorded=self.recorded)
