"""Report of the doctor, and the file that stores it for later sessions."""

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
"""Maximum age of a diagnosis in the record of a session."""


@dataclass(frozen=True, slots=True)
class Check:
    """One line of a diagnosis: what was checked, and the finding."""

    area: str
    finding: Finding


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The state of a computer.

    Attributes
    ----------
    computer
        Its name on the network.
    made
        Time of the check, ISO 8601 with time zone.
    checks
        The checks, in order.
    left_out
        What was not checked, and how to check it.
    """

    computer: str
    made: str
    checks: tuple[Check, ...]
    left_out: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst verdict."""
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
    """Return a diagnosis of this computer, made now."""
    made = datetime.now(UTC).isoformat(timespec="seconds")
    return Diagnosis(platform.node(), made, tuple(checks), tuple(left_out))


def keep(found: Diagnosis, data: Path) -> Path:
    """Store a diagnosis in the study's data folder, and return its path."""
    path = data / FILE
    write_text(path, json.dumps(found.as_data(), indent=1, ensure_ascii=False) + "\n")
    return path


def latest(data: Path, now: datetime | None = None) -> Mapping[str, Any] | None:
    """Return the stored diagnosis, if it is of this computer and of the last 24 hours.

    Raises
    ------
    RecordingError
        The file exists but contains no diagnosis.
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
            f"{path} contains no diagnosis ({error!r}); run labcrane doctor again, or remove "
            "the file"
        ) from error
    return found if same and timedelta(0) <= age < FRESH else None
