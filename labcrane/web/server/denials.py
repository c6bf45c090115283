"""Denials: what pages refuse, told without becoming a flood themselves."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Bucket:
    """Lets through so many a second on average, and as many at once as ``most``."""

    rate: float
    most: float
    clock: Callable[[], float] = time.monotonic
    _left: float = field(init=False)
    _at: float = field(init=False)

    def __post_init__(self) -> None:
        self._left, self._at = self.most, self.clock()

    def take(self) -> bool:
        """Whether one more may pass."""
        now = self.clock()
        self._left = min(self.most, self._left + (now - self._at) * self.rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Denials:
    """Tells of refusals: the first ones each, a flood of them once a second, with their number.

    What every refusal sent to the loop and the record would be a flood there as well.
    """

    AT_ONCE = 20

    def __init__(
        self, tell: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._tell = tell
        self._bucket = Bucket(1.0, self.AT_ONCE, clock)
        self._lock = threading.Lock()
        self._more = 0
        self._last = ""

    def __call__(self, why: str) -> None:
        """Tell of one, or count it."""
        with self._lock:
            if not self._bucket.take():
                self._more += 1
                self._last = why
                return
        self.flush()
        self._tell(why)

    def flush(self) -> None:
        """Report how many were counted since the last report."""
        with self._lock:
            more, last, self._more = self._more, self._last, 0
        if more:
            self._tell(f"{more} more refusals, the last: {last}")
