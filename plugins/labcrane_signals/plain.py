"""Any regular stream of numbers, and force sensors."""

import numpy as np

from labcrane import FloatArray
from labcrane.core import SignalFault, SignalStream
from labcrane_signals.channels import signal_columns
from labcrane_signals.rails import Rails
from labcrane_signals.settings import ForceSettings
from labcrane_signals.windows import BoolArray, WindowedMonitor

SPECIAL = frozenset(
    {"eeg", "ecg", "ekg", "emg", "gaze", "force", "joystick", "joysticks", "stick", "sticks"}
    | {"axes", "gamepad", "marker", "markers", "event", "events", "audio", "videoraw"}
)
"""Types that have their own monitor, or that may be constant for long."""

NEED = {"no values": 6, "flat line": 6, "railing": 6, "wrong unit": 6}
MOVED = 20
"""Windows in which a channel must have moved until its standing still is a fault."""

ADVICE = {
    "no values": "sends no numbers: check the device's program",
    "flat line": "no longer changes: check the sensor's cable",
    "railing": "is held at {value:.4g}, a limit of its converter: check the sensor's range",
    "wrong unit": "{value:.4g} is beyond {largest:g}, the most it can measure: correct its unit or "
    "its calibration",
}


class PlainMonitor(WindowedMonitor):
    """Tells flat lines, rails and missing values of any regular stream.

    Standing still is a fault of a channel that has moved all the time before, or of all channels
    together.
    """

    types: frozenset[str] = frozenset()
    """Types that it knows; empty for all that no other monitor does."""

    moved = MOVED
    """Windows in which a channel must have moved until its standing still is a fault."""

    largest = np.inf
    """Largest value that can be measured, in the unit of the stream."""

    def knows(self, stream: SignalStream) -> bool:
        kind = stream.type.lower()
        wanted = kind in self.types if self.types else kind not in SPECIAL
        return wanted and stream.rate_hz > 0 and bool(signal_columns(stream))

    def begin(self, stream: SignalStream) -> None:
        columns = signal_columns(stream)
        self.watch(stream, columns, NEED)
        self._rails = Rails(len(columns))
        self._lively = np.zeros(len(columns), dtype=np.int64)

    def _judge(self, window: FloatArray) -> list[SignalFault]:
        none: BoolArray = np.asarray(~np.isfinite(window).all(axis=0))
        window = np.where(none, 0.0, window)
        flat, rails = self._rails.evaluate(window)
        flat = np.asarray(flat & ~none)
        all_flat = bool(flat.any() and (flat | none).all())
        expected = self._lively >= self.moved
        moving = ~(flat | rails | none)
        steps = (np.diff(window, axis=0) != 0.0).mean(axis=0)
        # A channel that rests now and then is not expected to move all the time.
        rests = flat & ~expected
        self._lively = np.where(
            rests,
            0,
            self._lively + (moving & (steps > 0.5)),  # noqa: PLR2004 - most samples differ
        )
        bad = {
            "no values": none,
            "flat line": flat & (expected | all_flat),
            "railing": rails & expected,
            "wrong unit": np.median(np.abs(window), axis=0) > self.largest,
        }
        return [
            SignalFault(
                self._labels[at],
                kind,
                ADVICE[kind].format(value=window[-1, at], largest=self.largest),
            )
            for kind, now in bad.items()
            for at in np.flatnonzero(self._streaks[kind].add(now))
        ]


class ForceMonitor(PlainMonitor):
    """Tells flat lines, rails and impossible values of force sensors: a live one is never still."""

    types = frozenset({"force"})
    moved = 0

    def __init__(self, settings: ForceSettings) -> None:
        self.largest = settings.largest or np.inf
