"""Keys as axes."""

import math
import socket
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Run, Signal, StreamError, Tick
from labcrane.core import Value
from labcrane.streams import NewestSample, numeric_labels
from labcrane_keyboard.settings import KeyboardSettings

if TYPE_CHECKING:
    import pylsl

FIRST_LOOK_S = 1.0
"""How long opening waits for the view, which is there before the session."""


class Keyboard(InputDevice):
    """Takes the state of the keys from a view's stream: its window has the focus, SDL has none.

    Every axis is -1, 0 or 1 by its two keys, reached by a ramp. A view that falls silent is a
    fault, and all axes are then at rest at once.
    """

    def __init__(self, settings: KeyboardSettings) -> None:
        self.signals = (
            Signal("keyboard", "1", tuple(settings.axes)),
            Signal("view.connected", "1"),
        )
        self._settings = settings
        self._stream = f"labcrane.feedback.{settings.view}.keys"
        self._out = np.zeros(len(settings.axes) + 1)
        self._wanted = [0.0] * len(settings.axes)
        self._pairs: list[tuple[int, int]] = []
        self._came = -math.inf
        self._seen = False
        self._complaint = ""
        self._keys: NewestSample | None = None

    def open(self, run: Run) -> None:
        self._rise, self._fall = (
            1.0 if seconds == 0.0 else 1.0 / (seconds * run.rate_hz)
            for seconds in (self._settings.ramp_s, self._settings.fall_s)
        )
        here = {"name": self._stream, "hostname": socket.gethostname()}
        self._keys = NewestSample(here, self._accept)
        self._keys.wait(FIRST_LOOK_S)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        out = self._out
        self._pull(tick.woke)
        if tick.woke - self._came > self._settings.timeout_s:
            self.fault = self._trouble()
            self._wanted = [0.0] * len(self._wanted)
            out[:] = 0.0
            return out
        self.fault = None
        for axis, wanted in enumerate(self._wanted):
            step = self._rise if wanted else self._fall
            away = wanted - out[axis]
            out[axis] = wanted if abs(away) <= step else out[axis] + math.copysign(step, away)
        out[-1] = 1.0
        return out

    def close(self) -> None:
        if self._keys is not None:
            self._keys.close()
            self._keys = None

    def metadata(self) -> Mapping[str, Value]:
        keys = {f"{axis}.keys": " ".join(pair) for axis, pair in self._settings.axes.items()}
        return {"view": self._settings.view, **keys}

    def _trouble(self) -> str:
        view, wait = self._settings.view, self._settings.timeout_s
        if complaint := self._complaint or (self._keys.complaint if self._keys else ""):
            return complaint
        if self._seen:
            return f"view {view!r} has sent no keys for {wait:g} s; its window may be closed"
        keys = ", ".join(key for pair in self._settings.axes.values() for key in pair)
        return f"no view {view!r} sends keys; write keys: [{keys}] under views: {view}"

    def _pull(self, now: float) -> None:
        keys = self._keys
        if keys is None or not keys.connected:
            return
        if not self._seen:  # what there is now counts from now: the first sample is on its way
            self._seen, self._came = True, now
        if (newest := keys.newest()) is None:
            return
        states = [newest[key] for pair in self._pairs for key in pair]
        wrong = [state for state in states if not 0.0 <= state <= 1.0]  # NaN too
        if wrong:
            self._complaint = (
                f"view {self._settings.view!r} sent the key state {wrong[0]:g}, which is not "
                "within 0 and 1"
            )
            return
        self._came, self._complaint = now, ""
        self._wanted = [newest[more] - newest[less] for less, more in self._pairs]

    def _accept(self, info: "pylsl.StreamInfo") -> None:
        """Take where each key is in a view's stream."""
        try:
            labels = numeric_labels(info)
        except StreamError as error:
            raise StreamError(f"stream {self._stream!r} is not from a view: {error}") from error
        sent = [label.removeprefix("key.") for label in labels if label.startswith("key.")]
        missing = [key for pair in self._settings.axes.values() for key in pair if key not in sent]
        if missing:
            raise StreamError(
                f"view {self._settings.view!r} sends the keys {', '.join(sent)}; the keyboard also "
                f"needs {', '.join(missing)}: write them under its keys"
            )
        self._pairs = [
            (labels.index(f"key.{less}"), labels.index(f"key.{more}"))
            for less, more in self._settings.axes.values()
        ]
