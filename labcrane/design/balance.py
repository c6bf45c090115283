"""Counts that show whether a design is balanced."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise


def positions(orders: Iterable[Sequence[str]]) -> Counter[tuple[int, str]]:
    """Count how often each level is in each position, from 1."""
    return Counter((at, level) for order in orders for at, level in enumerate(order, start=1))


def carry_over(orders: Iterable[Sequence[str]]) -> Counter[tuple[str, str]]:
    """Count how often each level directly follows each other one."""
    return Counter(pair for order in orders for pair in pairwise(order))


def spread(counts: Counter[tuple[int, str]] | Counter[tuple[str, str]], cells: int) -> int:
    """Return the largest count less the smallest of ``cells``; those not counted are 0."""
    most = max(counts.values(), default=0)
    return most - (min(counts.values(), default=0) if len(counts) >= cells else 0)
