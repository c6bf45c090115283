"""Random sequences in which no level comes more than so often in a row."""

import random
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from functools import cache
from itertools import accumulate

from labcrane.errors import ProtocolError


@cache
def _ways(others: tuple[int, ...], left: int, run: int, most: int) -> int:
    """Count the ways to go on when the last level has come ``run`` times in a row.

    ``left`` is how often that level is still to come, ``others`` the same of all others, sorted.
    """
    if left == 0 and not any(others):
        return 1
    total = _ways(others, left - 1, run + 1, most) if left and run < most else 0
    for count, levels in Counter(others).items():
        if count:
            rest = list(others)
            rest.remove(count)
            total += levels * _ways(tuple(sorted((*rest, left))), count - 1, 1, most)
    return total


def sequence(levels: Sequence[str], times: int, most: int, seed: int) -> tuple[str, ...]:
    """Return each level ``times`` times, none more than ``most`` times in a row.

    Every allowed sequence is equally likely: at each place a level is drawn with the exact number
    of ways to go on after it as its weight.

    Raises
    ------
    ProtocolError
        There is no such sequence.
    """
    # Python's generator, because the weights are whole numbers beyond 64 bits.
    draw = random.Random(seed)  # noqa: S311 - orders trials, guards no secret
    left = dict.fromkeys(levels, times)
    chosen: list[str] = []
    last, run = None, 0
    while len(chosen) < times * len(left):
        weights = {}
        for level in left:
            again = level == last
            if left[level] and not (again and run >= most):
                others = tuple(sorted(left[other] for other in left if other != level))
                weights[level] = _ways(others, left[level] - 1, run + 1 if again else 1, most)
        bounds = list(accumulate(weights.values()))
        if not bounds or bounds[-1] == 0:
            raise ProtocolError(
                f"{len(left)} levels, {times} times each, cannot be ordered with no more than "
                f"{most} in a row; allow more in a row"
            )
        level = list(weights)[bisect_right(bounds, draw.randrange(bounds[-1]))]
        last, run = level, run + 1 if level == last else 1
        left[level] -= 1
        chosen.append(level)
    return tuple(chosen)
