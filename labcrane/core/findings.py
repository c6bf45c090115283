"""Findings of a check: of a session's time stamps, or of a machine."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Self


class Verdict(StrEnum):
    """How good something is, in words that can be ordered."""

    PASS = "PASS"  # noqa: S105 - no password
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True, slots=True)
class Finding:
    """How something is, and what to do about it.

    Attributes
    ----------
    verdict
        Whether it is as it should be.
    text
        What was looked at and what it is like, with numbers and units.
    advice
        What to do; empty where nothing needs to be done.
    """

    verdict: Verdict
    text: str
    advice: str = ""

    @classmethod
    def failed(cls, error: Exception) -> Self:
        """Return an error as a finding: what to do is what it says after its last semicolon."""
        said, _, fix = str(error).rpartition("; ")
        return cls(Verdict.FAIL, said or fix, fix if said else "")


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the worst verdict; PASS when there is none."""
    order = list(Verdict)
    return max(verdicts, key=order.index, default=Verdict.PASS)
