"""Keys as axes."""

import math
import socket
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Run, Signal, Tick, Value
from labcrane_keyboard.settings import KeyboardSettings

if TYPE_CHECKING:
    import pylsl

FIRST_LOOK_S = 1.0
"""How long opening waits for the view, which is there before the session."""

MOST_A_TICK = 64
"""Samples taken in one tick; a view that sends more is read on in the next."""

LOOK_S = 0.2
"""Time between later looks, in a thread of their own: they may take long."""


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
        self._inlet: pylsl.StreamInlet | None = None
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self, run: Run) -> None:
        self._rise, self._fall = (
            1.0 if seconds == 0.0 else 1.0 / (seconds * run.rate_hz)
            for seconds in (self._settings.ramp_s, self._settings.fall_s)
        )
        self._look(FIRST_LOOK_S)
        self._thread = threading.Thread(target=self._look_on, name="labcrane-keyboard", daemon=True)
        self._thread.start()

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
        self._over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._inlet = None

    def metadata(self) -> Mapping[str, Value]:
        keys = {f"{axis}.keys": " ".join(pair) for axis, pair in self._settings.axes.items()}
        return {"view": self._settings.view, **keys}

    def _trouble(self) -> str:
        view, wait = self._settings.view, self._settings.timeout_s
        if self._complaint:
            return self._complaint
        if self._seen:
            return f"view {view!r} has sent no keys for {wait:g} s; its window may be closed"
        keys = ", ".join(key for pair in self._settings.axes.values() for key in pair)
        return f"no view {view!r} sends keys; write keys: [{keys}] under views: {view}"

    def _pull(self, now: float) -> None:
        inlet = self._inlet
        if inlet is None:
            return
        if not self._seen:  # what there is now counts from now: the first sample is on its way
            self._seen, self._came = True, now
        newest = None
        for _ in range(MOST_A_TICK):
            sample, stamp = inlet.pull_sample(timeout=0.0)
            if stamp is None:
                break
            newest = sample
        if newest is None:
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

    def _look_on(self) -> None:
        while self._inlet is None and not self._over.wait(LOOK_S):
            self._look(LOOK_S)

    def _look(self, patience_s: float) -> None:
        """Find the view's stream; once found, it comes back by itself when the view does."""
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        found = pylsl.resolve_byprop("name", self._stream, timeout=patience_s)
        here = [info for info in found if info.hostname() == socket.gethostname()]
        if not here:
            return
        inlet = pylsl.StreamInlet(here[0], max_buflen=2, recover=True)
        try:
            info = inlet.info(timeout=2.0)
            labels = info.get_channel_labels() or []
            inlet.open_stream(timeout=2.0)
        except (pylsl.util.TimeoutError, pylsl.util.LostError):
            return  # gone again; it is looked for once more
        if info.channel_format() == pylsl.cf_string or len(labels) > info.channel_count():
            self._complaint = (
                f"stream {self._stream!r} has {info.channel_count()} channels of format "
                f"{info.channel_format()}, and {len(labels)} names; it is no view's"
            )
            return
        sent = [label.removeprefix("key.") for label in labels if label.startswith("key.")]
        missing = [key for pair in self._settings.axes.values() for key in pair if key not in sent]
        if missing:
            self._complaint = (
                f"view {self._settings.view!r} sends the keys {', '.join(sent)}; the keyboard also "
                f"needs {', '.join(missing)}: write them under its keys"
            )
            return
        self._pairs = [
            (labels.index(f"key.{less}"), labels.index(f"key.{more}"))
            for less, more in self._settings.axes.values()
        ]
        self._complaint, self._inlet = "", inlet
