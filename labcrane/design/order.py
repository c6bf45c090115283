"""Order of a factor's levels."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labcrane.design.sampling import sequence
from labcrane.design.squares import Square, latin_square, williams


@dataclass(frozen=True, slots=True)
class Turn:
    """The participant of an order.

    Attributes
    ----------
    seed
        Seed of everything random in it.
    place
        Number of the participant in the group, from 0, by slots in the design; it selects the row
        of a square.
    """

    seed: int
    place: int = 0


def shuffled(levels: Sequence[str], seed: int) -> tuple[str, ...]:
    """Return the levels in a random order that follows from ``seed``."""
    order = np.random.default_rng(seed).permutation(len(levels))
    return tuple(levels[index] for index in order)


def complete(levels: Sequence[str], turn: Turn, times: int, most: int | None) -> tuple[str, ...]:
    """Shuffle all repetitions together: complete randomisation."""
    if most is None:
        return shuffled(tuple(levels) * times, turn.seed)
    return sequence(levels, times, most, turn.seed)


def blocked(levels: Sequence[str], turn: Turn, times: int, most: int | None) -> tuple[str, ...]:
    """Shuffle each repetition by itself, so that all levels come before any comes again."""
    random = np.random.default_rng(turn.seed)
    chosen: list[str] = []
    for _ in range(times):
        order = random.permutation(len(levels))
        # A level can be its own neighbour only where two repetitions meet.
        while most == 1 and len(levels) > 1 and chosen and levels[order[0]] == chosen[-1]:
            order = random.permutation(len(levels))
        chosen += [levels[index] for index in order]
    return tuple(chosen)


def written(levels: Sequence[str], turn: Turn, times: int, most: int | None) -> tuple[str, ...]:
    """Repeat the levels in the order of the protocol."""
    del turn, most
    return tuple(levels) * times


def _row_of(square: Callable[[int], Square]) -> "Rule":
    def rule(levels: Sequence[str], turn: Turn, times: int, most: int | None) -> tuple[str, ...]:
        del most
        rows = square(len(levels))
        return tuple(levels[index] for index in rows[turn.place % len(rows)]) * times

    return rule


Rule = Callable[[Sequence[str], Turn, int, int | None], tuple[str, ...]]
"""Levels, whose turn, repetitions of each level, most in a row -> the order."""

RULES: Mapping[str, Rule] = {
    "as_written": written,
    "shuffled": complete,
    "blocked": blocked,
    "latin_square": _row_of(latin_square),
    "williams": _row_of(williams),
}
"""Functions of the rules under ``design: order:``."""

SQUARES: Mapping[str, Callable[[int], Square]] = {
    "latin_square": latin_square,
    "williams": williams,
}
"""Rules that give each participant a row of a square."""


def faded(count: int, shares: Sequence[float]) -> list[bool]:
    """Return which of ``count`` trials have feedback: ``shares`` of them, part by part.

    Within a part they are spread evenly, the first trial of a part having feedback unless its
    share is 0.
    """
    chosen = []
    for part, share in enumerate(shares):
        first, last = part * count // len(shares), (part + 1) * count // len(shares)
        size = last - first
        wanted = round(share * size)
        chosen += [(at * wanted) % size < wanted for at in range(size)]
    return chosen
