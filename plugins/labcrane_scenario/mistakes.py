"""Episodes of contact beyond a limit, and how many there were."""

from collections.abc import Mapping
from dataclasses import dataclass, field


class ContactEpisode:
    """One force against its limit.

    An episode begins beyond the limit and ends when the force has been below a share of it for a
    while: a contact that trembles is one mistake.

    Parameters
    ----------
    limit
        In N.
    release
        Share of the limit below which the episode may end.
    hold
        How many ticks it must stay there.
    """

    def __init__(self, limit: float, release: float, hold: int) -> None:
        self._limit = limit
        self._end = release * limit
        self._hold = hold
        self._quiet = 0
        self.on = False
        self.peak = 0.0

    def see(self, force: float) -> bool:
        """Take a tick's force in N; return whether an episode begins with it."""
        self.peak = max(self.peak, force)
        if force > self._limit:
            began, self.on, self._quiet = not self.on, True, 0
            return began
        if self.on and force < self._end:
            self._quiet += 1
            self.on = self._quiet <= self._hold
        else:
            self._quiet = 0
        return False


KINDS = {
    "object": "contacts with an object beyond the allowed force",
    "body": "contacts with the body beyond the allowed force",
    "overload_max": "times that a joint was overloaded in its positive direction",
    "overload_min": "times that a joint was overloaded in its negative direction",
    "drop": "times that something slipped out of the jaws and fell, or was let go from too high",
}
"""Kinds of mistakes, each counted separately, and their definitions."""

ENDING = tuple(kind for kind in KINDS if kind != "drop")
"""Kinds of which too many end a run: those that the paper counts. Other kinds are only reported."""


@dataclass
class Mistakes:
    """How many mistakes of each kind there were."""

    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))

    def add(self, kind: str) -> int:
        """Count a mistake; return how many of its kind there are now."""
        self.counts[kind] += 1
        return self.counts[kind]

    def results(self) -> Mapping[str, float]:
        """Return the counts by the names of the trial table."""
        return {f"n_{kind}": float(count) for kind, count in self.counts.items()}
