"""Configuration of an estimate's process."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class EstimateConfig:
    """What an estimate's process is to do.

    Attributes
    ----------
    study, recorded
        The protocol, and whether it is read as the record of what was run.
    name
        The protocol's name for the estimate.
    source
        The session (:attr:`labcrane.session.visit.Visit.source`).
    """

    study: Path
    recorded: bool
    name: str
    source: str
