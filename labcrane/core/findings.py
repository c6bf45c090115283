"""Findings of a check: of a session's timestamps, or of a machine."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Self


class Verdict(StrEnum):
    """Verdicts, in order of severity."""

    PASS = "PASS"  # noqa: S105 - no password
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of a check, and its remedy.

    Attributes
    ----------
    verdict
        Whether the check passed.
    text
        What was checked and the result, with numbers and units.
    advice
        The remedy; empty if none is needed.
    """

    verdict: Verdict
    text: str
    advice: str = ""

    @classmethod
    def failed(cls, error: Exception) -> Self:
        """Return an error as a finding; its text after the last semicolon is the remedy."""
        said, _, fix = str(error).rpartition("; ")
        return cls(Verdict.FAIL, said or fix, fix if said else "")


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst verdict; PASS when there is none."""
    order = list(Verdict)
    return max(verdicts, key=order.index, default=Verdict.PASS)
