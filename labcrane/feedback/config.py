"""Configuration of a feedback process, as a line of text."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from labcrane.core.records import Run
from labcrane.feedback.delays import Measured, measured_of
from labcrane.recording.run_codec import read_run, write_run


@dataclass(frozen=True, slots=True)
class Part:
    """A component by its offer's name and its settings."""

    use: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class FeedbackConfig:
    """What a feedback process is told.

    Attributes
    ----------
    name
        The protocol's name for it.
    part, cues
        What it runs, and which cues it draws, by the protocol's names.
    run
        What is presented.
    source
        Whose streams it follows (:attr:`labcrane.session.session.Visit.source`).
    study
        The protocol, beside which there may be plugins.
    always
        Whether it presents every frame, or only those of trials in which it is switched on.
    measured
        What was measured of its delay, if anything was.
    recorded
        Whether there is a recorder, without which it presents nothing; a preview has none.
    streams
        Descriptions of the session's streams by name, when there are any yet.
    """

    name: str
    part: Part
    run: Run
    source: str
    study: Path
    always: bool
    cues: Mapping[str, Part] = field(default_factory=dict)
    measured: Measured | None = None
    recorded: bool = True
    streams: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> str:
        """Return the order as one line."""
        fields = {
            "name": self.name,
            "part": asdict(self.part),
            "run": write_run(self.run),
            "source": self.source,
            "study": str(self.study.resolve()),
            "always": self.always,
            "cues": {name: asdict(part) for name, part in self.cues.items()},
            "measured": asdict(self.measured) if self.measured else None,
            "recorded": self.recorded,
            "streams": dict(self.streams),
        }
        return json.dumps(fields)

    @classmethod
    def from_json(cls, text: str) -> "FeedbackConfig":
        """Return the order that :meth:`as_json` wrote."""
        found = json.loads(text)
        return cls(
            found["name"],
            Part(**found["part"]),
            read_run(found["run"]),
            found["source"],
            Path(found["study"]),
            found["always"],
            {name: Part(**part) for name, part in found["cues"].items()},
            measured_of(found["measured"]) if found["measured"] else None,
            found["recorded"],
            found["streams"],
        )
