"""Report of the doctor, and the file that keeps it for the sessions that follow."""

import json
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from labcrane.core.findings import Finding, Verdict, worst
from labcrane.errors import RecordingError
from labcrane.files.atomic import write_text

FILE = "doctor.json"
"""Name of the file in the study's data folder."""

FRESH = timedelta(hours=24)
"""Age up to which a diagnosis goes into the record of a session."""


@dataclass(frozen=True, slots=True)
class Check:
    """One line of a diagnosis: what was looked at, and how it is."""

    area: str
    finding: Finding


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """How a computer was found.

    Attributes
    ----------
    computer
        Its name on the network.
    made
        When it was looked at, ISO 8601 with time zone.
    checks
        In the order in which they were made.
    left_out
        What was not looked at, and how it would be.
    """

    computer: str
    made: str
    checks: tuple[Check, ...]
    left_out: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        return worst(check.finding.verdict for check in self.checks)

    def as_data(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {
            "computer": self.computer,
            "made": self.made,
            "verdict": self.verdict.value,
            "checks": [as_data(check) for check in self.checks],
            "left_out": list(self.left_out),
        }


def as_data(check: Check) -> dict[str, str]:
    """Return a check ready for JSON."""
    found = check.finding
    return {
        "area": check.area,
        "verdict": found.verdict.value,
        "text": found.text,
        "advice": found.advice,
    }


def diagnosis(checks: Iterable[Check], left_out: Iterable[str] = ()) -> Diagnosis:
    """Return what was found on this computer, now."""
    made = datetime.now(UTC).isoformat(timespec="seconds")
    return Diagnosis(platform.node(), made, tuple(checks), tuple(left_out))


def keep(found: Diagnosis, data: Path) -> Path:
    """Keep a diagnosis in the study's data folder, and return where."""
    path = data / FILE
    write_text(path, json.dumps(found.as_data(), indent=1, ensure_ascii=False) + "\n")
    return path


def latest(data: Path, now: datetime | None = None) -> Mapping[str, Any] | None:
    """Return the diagnosis that was kept, if it is of this computer and of the last 24 hours.

    Raises
    ------
    RecordingError
        The file is there and holds no diagnosis.
    """
    path = data / FILE
    if not path.is_file():
        return None
    try:
        found: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        age = (now or datetime.now(UTC)) - datetime.fromisoformat(found["made"])
        same = found["computer"] == platform.node()
    except (ValueError, KeyError, TypeError) as error:
        raise RecordingError(
            f"{path} holds no diagnosis ({error!r}); run labcrane doctor again, or remove the file"
        ) from error
    return found if same and timedelta(0) <= age < FRESH else None
