"""Random sequences with a limit of repetitions of a level in a row."""

import random
from bisect import bisect_right, insort
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate

from labcrane.errors import ProtocolError

State = tuple[tuple[int, ...], int, int]
"""How often every other level is still to come, sorted; the last level; how often in a row it
has."""


class Ways:
    """The number of continuations, with no level more than ``most`` times in a row."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._known: dict[State, int] = {}

    def count(self, state: State) -> int:
        """Return a state's number of continuations; without recursion, which many levels exceed."""
        known = self._known
        waiting = [] if state in known else [(state, self._nexts(state))]
        while waiting:
            at, nexts = waiting[-1]
            if missing := [each for each, _ in nexts if each not in known]:
                waiting += [(each, self._nexts(each)) for each in missing]
                continue
            waiting.pop()
            done = not nexts and at[1] == 0 and not any(at[0])
            known[at] = 1 if done else sum(levels * known[each] for each, levels in nexts)
        return known[state]

    def _nexts(self, state: State) -> list[tuple[State, int]]:
        """Return the possible next states, and the number of levels for each."""
        others, left, run = state
        found = [((others, left - 1, run + 1), 1)] if left and run < self._most else []
        at = 0
        while at < len(others):
            count, levels = others[at], others.count(others[at])
            if count:
                rest = list(others)
                del rest[at]
                insort(rest, left)
                found.append(((tuple(rest), count - 1, 1), levels))
            at += levels
        return found


@lru_cache(maxsize=4)
def _ways(most: int, levels: int, times: int) -> Ways:
    """Return the counts that are the same for every participant's order."""
    del levels, times  # another design counts again, so that the cache does not grow
    return Ways(most)


def sequence(levels: Sequence[str], times: int, most: int, seed: int) -> tuple[str, ...]:
    """Return each level ``times`` times, none more than ``most`` times in a row.

    Every allowed sequence is equally likely: at each place a level is drawn with the exact number
    of continuations as its weight.

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
    ways = _ways(most, len(left), times)
    while len(chosen) < times * len(left):
        weights = {}
        for level in left:
            again = level == last
            if left[level] and not (again and run >= most):
                others = tuple(sorted(left[other] for other in left if other != level))
                weights[level] = ways.count((others, left[level] - 1, run + 1 if again else 1))
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
