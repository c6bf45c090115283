"""Latin and Williams squares: each row is one participant's order of ``0 .. n-1``."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

Square = tuple[tuple[int, ...], ...]


def latin_square(n: int) -> Square:
    """Return the cyclic square: every item once in every row and in every position."""
    return tuple(tuple((row + column) % n for column in range(n)) for row in range(n))


def williams(n: int) -> Square:
    """Return a square in which every item also follows every other one equally often.

    For even ``n`` there are ``n`` rows and each ordered pair of neighbours occurs once; for odd
    ``n`` the reversed rows are added, ``2 n`` in all, and each pair occurs twice (Williams 1949,
    Australian Journal of Scientific Research A 2, 149; first row after Bradley 1958, JASA 53, 525).
    """
    first = [(step + 1) // 2 if step % 2 else (n - step // 2) % n for step in range(n)]
    rows = tuple(tuple((item + row) % n for item in first) for row in range(n))
    return rows if n % 2 == 0 else rows + tuple(row[::-1] for row in rows)


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
