"""Staircases: harder after successes in a row, easier after failures in a row."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labcrane.protocol.tracks import UpDown

FEWEST = 2
"""Levels at reversals that make an estimate."""


@dataclass(frozen=True, slots=True)
class Staircase:
    """Where a staircase stands.

    Attributes
    ----------
    level
        The next level.
    turns
        How hard the levels were at which its direction changed, in the last block.
    """

    level: str
    turns: tuple[float, ...]

    def estimate(self, settings: UpDown) -> tuple[float, float]:
        """Return mean and standard deviation of the levels at reversals; NaN of fewer than two."""
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
    """Return where a staircase stands after some responses.

    At the hardest and the easiest level it stays where it cannot go on; that is no reversal.

    Parameters
    ----------
    levels
        How hard each is.
    responses
        The level of each trial and whether it was a success, in order.
    before
        How many of them were before the block whose reversals are counted.
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
