"""In which order the levels of a factor come."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

Rule = Callable[[Sequence[str], int], tuple[str, ...]]


def as_written(levels: Sequence[str], seed: int) -> tuple[str, ...]:
    """Return the levels in the protocol's order; ``seed`` does not matter."""
    del seed
    return tuple(levels)


def shuffled(levels: Sequence[str], seed: int) -> tuple[str, ...]:
    """Return the levels in a random order that follows from ``seed``."""
    order = np.random.default_rng(seed).permutation(len(levels))
    return tuple(levels[index] for index in order)


RULES: Mapping[str, Rule] = {"as_written": as_written, "shuffled": shuffled}
"""What a protocol may say under ``design: order:``."""
