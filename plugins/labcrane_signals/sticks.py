"""Axes of sticks that another program streams."""

import numpy as np

from labcrane import FloatArray
from labcrane.core import SignalFault, SignalStream
from labcrane_signals.channels import signal_columns
from labcrane_signals.settings import StickSettings
from labcrane_signals.windows import WindowedMonitor

TYPES = frozenset({"joystick", "joysticks", "stick", "sticks", "axes", "gamepad"})
SHARES = frozenset({"", "1", "normalized", "normalised", "norm"})
REST = 0.05
END = 0.97
"""Between these no hand holds a stick so still that no step of its converter is seen."""

BEYOND = 2.0
NEED = {"sticks dead": 6, "wrong unit": 6}
ADVICE = {
    "sticks dead": "stays at {value:.3f} without any tremor of a hand: plug it in again, "
    "and restart its program",
    "wrong unit": "{value:.3g} where -1 to 1 is stated: correct the scale in its program",
}


class StickMonitor(WindowedMonitor):
    """Detects sticks that failed away from rest, and a wrong unit.

    A stick exactly at rest may have been let go. This is not a fault, unless it trembled at rest
    before.
    """

    def __init__(self, settings: StickSettings) -> None:
        del settings  # it has none yet

    def knows(self, stream: SignalStream) -> bool:
        return stream.type.lower() in TYPES and stream.rate_hz > 0 and bool(signal_columns(stream))

    def begin(self, stream: SignalStream) -> None:
        columns = signal_columns(stream)
        self.watch(stream, columns, NEED)
        self._shares = np.array(
            [stream.channels[at].unit.strip().lower() in SHARES for at in columns]
        )
        self._trembling = np.zeros(len(columns), dtype=np.int64)

    def _judge(self, window: FloatArray) -> list[SignalFault]:
        low, high = window.min(axis=0), window.max(axis=0)
        place = np.abs(window[-1])
        still = low == high
        # An axis whose rest trembles has no dead zone that would hide a hand.
        resting = (place < REST) & (high - low < REST)
        calm = resting & ~still
        held = resting & still & (self._trembling < 2 * NEED["sticks dead"])
        self._trembling = np.where(calm, self._trembling + 1, np.where(held, 0, self._trembling))
        trembles = self._trembling >= 2 * NEED["sticks dead"]
        between = (place >= REST) & (place <= END)
        bad = {
            "sticks dead": (still & self._shares & (between | (resting & trembles)))
            | ~np.isfinite(window).all(axis=0),
            "wrong unit": self._shares & (np.median(np.abs(window), axis=0) > BEYOND),
        }
        return [
            SignalFault(self._labels[at], kind, ADVICE[kind].format(value=window[-1, at]))
            for kind, now in bad.items()
            for at in np.flatnonzero(self._streaks[kind].add(now))
        ]
