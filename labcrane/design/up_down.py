"""Staircases: harder after successes in a row, easier after failures in a row."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labcrane.protocol.tracks import UpDown

FEWEST = 2
"""Number of levels at reversals in an estimate."""


@dataclass(frozen=True, slots=True)
class Staircase:
    """State of a staircase.

    Attributes
    ----------
    level
        The next level.
    turns
        Difficulties of the levels at its reversals, in the last block.
    """

    level: str
    turns: tuple[float, ...]

    def estimate(self, settings: UpDown) -> tuple[float, float]:
        """Return mean and standard deviation of the levels at reversals; NaN for fewer than two."""
        kept = self.turns[settings.leave_out :]
        if len(kept) < FEWEST:
            return float("nan"), float("nan")
        return float(np.mean(kept)), float(np.std(kept, ddof=1))


def climb(
    settings: UpDown,
    levels: Mapping[str, float],
    start: str,
    responses: Sequence[tuple[str, bool]],
    before: int = 0,
) -> Staircase:
    """Return the state of a staircase after some responses.

    At the hardest and the easiest level it stays where it cannot go on; that is not a reversal.

    Parameters
    ----------
    levels
        Difficulty of each.
    responses
        The level of each trial and whether it was a success, in order.
    before
        Number of them before the block whose reversals are counted.
    """
    names = sorted(levels, key=levels.__getitem__)
    place = {name: at for at, name in enumerate(names)}
    at, heading, reversals = place[start or names[0]], 0, 0
    right = wrong = 0
    turns: list[float] = []
    shown = [None, *(level for level, _ in responses)]
    for number, ((last, level), (_, success)) in enumerate(
        zip(pairwise(shown), responses, strict=True)
    ):
        if level != last:
            right = wrong = 0
        right, wrong = (right + 1, 0) if success else (0, wrong + 1)
        move = (right == settings.harder_after) - (wrong == settings.easier_after)
        if not move:
            continue
        right = wrong = 0
        if move == -heading:
            reversals += 1
            if number >= before:
                turns.append(levels[str(level)])
        heading = move
        step = settings.steps[min(reversals, len(settings.steps) - 1)]
        at = min(max(place[str(level)] + move * step, 0), len(names) - 1)
    return Staircase(names[at], tuple(turns))


def settles_at(settings: UpDown) -> float:
    """Return the probability of a success at which getting harder and easier are as likely.

    That of so many successes in a row before so many failures in a row is one half there (Feller
    1968, section XIII.8).
    """
    runs, falls = settings.harder_after, settings.easier_after

    def harder(p: float) -> float:
        up, down = p ** (runs - 1), (1.0 - p) ** (falls - 1)
        return up * (1.0 - (1.0 - p) ** falls) / (up + down - up * down)

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (low, middle) if harder(middle) > 0.5 else (middle, high)  # noqa: PLR2004
    return (low + high) / 2.0
