"""Pulse: how long the newest code is on a line."""


class Pulse:
    """Knows when the line is to be cleared.

    Parameters
    ----------
    pulse_s
        How long a code stays, in seconds; 0 for ever.
    """

    def __init__(self, pulse_s: float) -> None:
        self._pulse_s = pulse_s
        self._until: float | None = None

    def begin(self, now: float) -> None:
        """Note that a code was put on the line at ``now``, in seconds."""
        self._until = now + self._pulse_s if self._pulse_s > 0.0 else None

    def is_over(self, now: float) -> bool:
        """Whether the line is to be cleared at ``now``, in seconds; said once."""
        if self._until is None or now < self._until:
            return False
        self._until = None
        return True
