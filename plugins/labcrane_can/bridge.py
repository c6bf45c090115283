"""From a CAN bus to the open gateway protocol and back (docs/gateway.md)."""

import math
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from labcrane_can.avc import ESTIMATED, encode_flow
from labcrane_can.command_state import PanelCommands
from labcrane_can.listener import Listener
from labcrane_can.settings import CanSettings

RATE_HZ = 50.0
FULL_PERCENT = 0.4
FLOW = "gateway.flow"
LOOK_S = 0.2
MOST_AT_ONCE = 64


class Bridge:
    """Pushes what the panel asks, and sends the valves' flow back to it.

    While the panel is silent, or one of its open valves is, nothing is pushed: the other end shuts
    the valves by itself.
    """

    def __init__(self, settings: CanSettings, name: str) -> None:
        self._settings = settings
        self._name = name
        self._commands = PanelCommands(settings)

    def __enter__(self) -> Self:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        joints = list(self._settings.valves)
        info = pylsl.StreamInfo(
            self._name, "Control", len(joints), 0.0, "float32", f"can/{self._settings.bus}"
        )
        channels = info.desc().append_child("channels")
        for joint in joints:
            channel = channels.append_child("channel")
            channel.append_child_value("label", joint)
            channel.append_child_value("unit", "0.4 percent")
        self._outlet = pylsl.StreamOutlet(info)
        self._flow: pylsl.StreamInlet | None = None
        self._valves: list[int | None] = []
        self._over = threading.Event()
        self._seeker = threading.Thread(target=self._seek, name="labcrane-flow", daemon=True)
        self._seeker.start()
        self._listener = Listener(self._settings, self._commands)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._seeker.join()
        self._listener.close()
        del self._outlet

    def run(self, seconds: float | None, say: Callable[[str], None]) -> None:
        """Bridge until ``seconds`` have passed, or for ever."""
        began, trouble, sent_back = time.perf_counter(), "", 0.0
        while seconds is None or time.perf_counter() - began < seconds:
            now = time.perf_counter()
            signals, _, there = self._commands.signals(now)
            new = self._listener.lost or (
                self._commands.silent(now) or "" if there else "the panel is silent"
            )
            if not new:
                self._outlet.push_sample(signals)
            if new != trouble:
                say(new or "the panel is there")
                trouble = new
            if now - sent_back > 0.1:  # noqa: PLR2004 - ten times a second
                self._send_back()
                sent_back = now
            time.sleep(1.0 / RATE_HZ)

    def _seek(self) -> None:
        """Look for the valves' flow: in a thread, because a look waits, and commands must not."""
        import pylsl  # noqa: PLC0415

        while not self._over.is_set():
            found = pylsl.resolve_byprop("name", FLOW, timeout=LOOK_S)
            if not found:
                continue
            inlet = pylsl.StreamInlet(found[0], max_buflen=1, recover=True)
            try:
                labels = inlet.info(timeout=2.0).get_channel_labels() or []
            except (pylsl.util.TimeoutError, pylsl.util.LostError):  # gone again: look for the next
                continue
            valves = self._settings.valves
            numbers = [valves.get(str(label)) for label in labels]
            self._valves = [each if isinstance(each, int) else None for each in numbers]
            self._flow = inlet
            return

    def _send_back(self) -> None:
        if self._flow is None:
            return
        sample, stamp = None, None
        for _ in range(MOST_AT_ONCE):
            next_ = self._flow.pull_sample(timeout=0.0)
            if next_[1] is None:
                break
            sample, stamp = next_
        if stamp is None or sample is None:
            return
        for flow, valve in zip(sample, self._valves, strict=False):
            if valve is not None and isinstance(flow, float) and math.isfinite(flow):
                percent = flow * FULL_PERCENT
                self._listener.send(
                    *encode_flow(ESTIMATED, valve, percent, self._settings.own_node)
                )
