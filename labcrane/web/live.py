"""Signals of machine, scenario and loop, from the session's LSL stream of whole frames."""

import threading
import time
from collections import deque
from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING

from labcrane.streams.frames import FRAME
from labcrane.streams.newest import NewestSample

if TYPE_CHECKING:
    import pylsl

PAUSE_S = 0.02
RECENT_S = 1.0
"""The lateness that is shown is the worst of this time."""

BAND_S = 0.5
BANDS = 120
"""Lateness is kept as the median and the worst of so long, for a minute."""


class Live:
    """Keeps the newest value of every signal, and how late the loop was.

    A thread pulls; readers get the latest data. The stream is found again when a session is.

    Attributes
    ----------
    newest
        The newest value of each column of a frame: ``state.joint.angle.slew``.
    units
        The unit of each column.
    moved
        Columns whose value has changed since the first frame.
    trouble
        Why the newest frames could not be taken up; empty when they were.
    """

    def __init__(self, source: str) -> None:
        self.newest: dict[str, float] = {}
        self.units: dict[str, str] = {}
        self.moved: set[str] = set()
        self.trouble = ""
        self._came: float | None = None
        self._bands: deque[tuple[float, float]] = deque(maxlen=BANDS)
        self._band: list[float] = []
        self._band_ends = 0.0
        self._source = source
        self._late: deque[tuple[float, float]] = deque()  # due and lateness of late ticks, in s
        threading.Thread(target=self._pull, name="live", daemon=True).start()

    @property
    def lateness_s(self) -> float | None:
        """How late the latest tick of the last second was, in seconds; None before the first."""
        late = [lateness for _, lateness in list(self._late)]
        return max(late) if late else None

    @property
    def silent_s(self) -> float | None:
        """How long no frame has come, in seconds; None before the first."""
        return None if self._came is None else time.monotonic() - self._came

    @property
    def bands(self) -> list[tuple[float, float]]:
        """Median and worst lateness of each half second of the last minute, in seconds."""
        return list(self._bands)

    def _pull(self) -> None:
        wanted = {"source_id": f"labcrane/{self._source}/{FRAME}"}
        frames = NewestSample(wanted, self._described, buffer_s=1)
        while True:
            samples, stamps = frames.pull()
            if stamps:
                self.hear(samples)
                self._came = time.monotonic()
            time.sleep(PAUSE_S)

    def hear(self, samples: Sequence[Sequence[float]]) -> None:
        """Take up frames, oldest first; what they cannot be taken up for is said on the page."""
        try:
            self._take(list(self.units), samples)
        # Whatever it is: a thread that dies of it would leave a page that stands still.
        except Exception as error:  # noqa: BLE001
            self.trouble = f"{type(error).__name__}: {error}"
        else:
            self.trouble = ""

    def _described(self, info: "pylsl.StreamInfo") -> None:
        units = {}
        channel = info.desc().child("channels").child("channel")
        while not channel.empty():
            units[channel.child_value("label")] = channel.child_value("unit")
            channel = channel.next_sibling("channel")
        self.units = units

    def _take(self, columns: Sequence[str], samples: Sequence[Sequence[float]]) -> None:
        due, woke = columns.index("due"), columns.index("woke")
        self._late.extend((sample[due], sample[woke] - sample[due]) for sample in samples)
        self._band.extend(max(0.0, sample[woke] - sample[due]) for sample in samples)
        newest = dict(zip(columns, samples[-1], strict=True))
        if newest["due"] >= self._band_ends:
            self._bands.append((median(self._band), max(self._band)))
            self._band, self._band_ends = [], newest["due"] + BAND_S
        while self._late[0][0] < newest["due"] - RECENT_S:
            self._late.popleft()
        self.moved |= {
            name for name, value in newest.items() if self.newest.get(name, value) != value
        }
        self.newest = newest
