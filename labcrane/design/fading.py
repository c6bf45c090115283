"""Taking feedback away bit by bit."""

from collections.abc import Sequence


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
