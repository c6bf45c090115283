"""Underruns: blocks that a sound server was not given in time, counted."""

WINDOW = 64
"""Number of blocks after which the server's clock is read again, because it drifts and restarts."""


class Underruns:
    """Counts missed blocks, from when the others were begun.

    A server asks for a block every period. One that is begun a whole period late was missing when
    it was to be played, and so were those in between. Computing it takes a few hundredths of a
    period, which is left out.

    Parameters
    ----------
    period_s
        Length of a block in seconds.

    Attributes
    ----------
    missed
        How many were not there in time.
    """

    def __init__(self, period_s: float) -> None:
        self.missed = 0
        self._period = period_s
        self._due = float("inf")
        self._least = float("inf")
        self._left = WINDOW

    def begun(self, now: float) -> None:
        """Note that the next block begins at ``now``, in seconds on any clock."""
        # The time of a block's request is unknown, but no block begins before it: the earliest
        # blocks show when they are due.
        late = now - self._due
        if late < 0.0 or self._due == float("inf"):
            self._due, late = now, 0.0
        whole = int(late / self._period)
        self.missed += whole
        self._due += whole * self._period
        self._least = min(self._least, now - self._due)
        self._left -= 1
        if self._left == 0:
            self._due += self._least
            self._least, self._left = float("inf"), WINDOW
        self._due += self._period
