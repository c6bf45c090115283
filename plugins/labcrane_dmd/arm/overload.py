"""Overload of a joint beyond what its drive can give."""

from collections.abc import Sequence

from labcrane_dmd.arm.settings import OverloadSettings


class Overload:
    """One joint's overload episodes; their direction is that of the drive's force.

    An episode ends when the load has been below the release for the hold time. A load that
    fluctuates around the limit is one overload.
    """

    def __init__(self, settings: OverloadSettings, dt: float) -> None:
        self._settings = settings
        self._hold = round(settings.hold_s / dt)
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self.direction = 0
        self._below = 0

    def see(self, load: float, *, driven: bool) -> int:
        """Take a tick's load, as a fraction of the effort with its sign; return -1, 0 or 1."""
        push = 1 if load > 0.0 else -1
        if abs(load) >= self._settings.limit and driven:
            self.direction, self._below = push, 0
        elif self.direction and (abs(load) < self._settings.release or push != self.direction):
            self._below += 1
            if self._below > self._hold:
                self.direction = 0
        else:
            self._below = 0
        return self.direction


def overloads(count: int, settings: OverloadSettings, dt: float) -> Sequence[Overload]:
    """Return an overload watch for each of ``count`` joints."""
    return tuple(Overload(settings, dt) for _ in range(count))
