"""Numbers of trials as people count them: trial 3 of 8, and practice apart.

A plan numbers everything that is run, approach movements and practice included; so does the record.
Every screen and every line counts the trials of :attr:`SessionPlan.trials`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

from labcrane.design.plan import SessionPlan


@dataclass(frozen=True, slots=True)
class TrialCounts:
    """Names of a session's trials for people.

    Attributes
    ----------
    counted
        Number of each counted trial, from 1, by its number in the plan.
    practice
        Number of each practice trial, from 1, by its number in the plan.
    """

    counted: Mapping[int, int]
    practice: Mapping[int, int]

    @classmethod
    def of(cls, plan: SessionPlan) -> Self:
        """Return the names of the trials of ``plan``, which must be complete."""
        practice = (
            trial
            for block in plan.blocks
            if block.practice
            for trial in block.trials
            if trial.planned.counted
        )
        return cls(
            {trial.number: place for place, trial in enumerate(plan.trials, start=1)},
            {trial.number: place for place, trial in enumerate(practice, start=1)},
        )

    @classmethod
    def recorded(cls, blocks: Iterable[Mapping[str, Any]]) -> Self:
        """Return the names of a recording's trials, by the ``plan`` in its context.

        Files older than that part of the context leave every trial without a name.
        """
        found: dict[bool, list[int]] = {False: [], True: []}
        for block in blocks:
            found[bool(block.get("practice"))] += block.get("counted", ())
        counted, practice = found[False], found[True]
        return cls(
            {number: place for place, number in enumerate(counted, start=1)},
            {number: place for place, number in enumerate(practice, start=1)},
        )

    @property
    def total(self) -> int:
        """Number of counted trials."""
        return len(self.counted)

    def name(self, number: int) -> str:
        """Return the name of the trial with this number in the plan."""
        if number in self.counted:
            return f"trial {self.counted[number]} of {self.total}"
        if number in self.practice:
            return f"practice trial {self.practice[number]}"
        return "an approach movement"

    def names(self, wanted: Iterable[int]) -> str:
        """Return the names of the trials with these numbers in the plan: ``trials 4-8 of 8``."""
        numbers = list(wanted)
        practice = [self.practice[number] for number in numbers if number in self.practice]
        counted = [self.counted[number] for number in numbers if number in self.counted]
        found = [f"practice {_trials(practice)}"] * bool(practice)
        found += [f"{_trials(counted)} of {self.total}"] * bool(counted)
        return ", ".join(found) or "no trial that is counted"


class TableNumbers:
    """Names of trials by the numbers of the record's trial table."""

    def name(self, number: int) -> str:
        """Return the name of the trial with this number in the plan."""
        return f"trial {number}"

    def names(self, wanted: Iterable[int]) -> str:
        """Return the names of the trials with these numbers in the plan."""
        return _trials(list(wanted))


def _trials(wanted: Sequence[int]) -> str:
    return f"trial{'s' if len(wanted) > 1 else ''} {spans(wanted)}"


def spans(wanted: Sequence[int]) -> str:
    """Return whole numbers as text: ``1-3 5``."""
    found = sorted(set(wanted))
    gaps = [at for at, (one, two) in enumerate(pairwise(found), start=1) if two > one + 1]
    runs = [found[start:end] for start, end in pairwise([0, *gaps, len(found)]) if start < end]
    return " ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs)


def numbers(text: str) -> list[int]:
    """Return the numbers that :func:`spans` wrote."""
    ends = [[int(end) for end in run.split("-")] for run in text.split()]
    return [number for run in ends for number in range(run[0], run[-1] + 1)]
