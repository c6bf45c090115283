"""Slots: places in the design, each of one participant at a time.

A slot determines the between-subject group and the row of every square. A participant who drops out
releases the slot for the next one, so that groups stay equal.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from functools import lru_cache

from labcrane.design.order import shuffled
from labcrane.design.seeds import derive


def group_of(study: str, groups: Sequence[str], slot: int) -> str:
    """Return the group of a slot, counted from 1; "" when the study has no groups.

    Each run of as many slots as there are groups holds every group once, in an order of its own.
    """
    if not groups:
        return ""
    run, place = divmod(slot - 1, len(groups))
    return _run_of(study, tuple(groups), run + 1)[place]


@lru_cache(maxsize=10_000)
def _run_of(study: str, groups: tuple[str, ...], number: int) -> tuple[str, ...]:
    return shuffled(groups, derive(study, "groups", number))


def place_of(groups: Sequence[str], slot: int) -> int:
    """Return how many slots of the same group come before this one."""
    return (slot - 1) // max(1, len(groups))


def next_slot(study: str, groups: Sequence[str], taken: Collection[int]) -> int:
    """Return the slot of the next participant: a free one, of the smallest group, the first such.

    Slots are handed out in order, so free ones among them were released. A slot that several
    laboratories handed out is in ``taken`` as often.
    """
    last = max(taken, default=0)
    free = [slot for slot in range(1, last + 1) if slot not in taken]
    if not free:  # one of each group: after a merge, the next one may not be of the smallest
        free = list(range(last + 1, last + 1 + max(1, len(groups))))
    sizes = Counter(group_of(study, groups, slot) for slot in taken)
    return min(free, key=lambda slot: (sizes[group_of(study, groups, slot)], slot))
