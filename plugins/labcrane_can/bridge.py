"""Bridge from a CAN bus to the open gateway protocol and back (docs/gateway.md)."""

import math
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Self

from labcrane.streams import NewestSample
from labcrane_can.avc import ESTIMATED, encode_flow
from labcrane_can.command_state import PanelCommands
from labcrane_can.listener import Listener
from labcrane_can.settings import CanSettings

if TYPE_CHECKING:
    import pylsl

RATE_HZ = 50.0
FULL_PERCENT = 0.4
FLOW = "gateway.flow"


class Bridge:
    """Push the panel's commands to LSL, and send the valves' flow back to the panel.

    While the panel, or one of its open valves, is silent, nothing is pushed: the other end then
    shuts the valves by itself.
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
        self._valves: list[int | None] = []
        self._flow = NewestSample({"name": FLOW}, self._accept, buffer_s=1)
        self._listener = Listener(self._settings, self._commands)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._flow.close()
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

    def _accept(self, info: "pylsl.StreamInfo") -> None:
        """Take which valve each channel of the flow is."""
        valves = self._settings.valves
        numbers = [valves.get(str(label)) for label in info.get_channel_labels() or []]
        self._valves = [each if isinstance(each, int) else None for each in numbers]

    def _send_back(self) -> None:
        if (sample := self._flow.newest()) is None:
            return
        for flow, valve in zip(sample, self._valves, strict=False):
            if valve is not None and isinstance(flow, float) and math.isfinite(flow):
                percent = flow * FULL_PERCENT
                self._listener.send(
                    *encode_flow(ESTIMATED, valve, percent, self._settings.own_node)
                )
