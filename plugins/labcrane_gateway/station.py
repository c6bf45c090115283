"""A control station that speaks the open gateway protocol (docs/gateway.md)."""

import math
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Machine, Run, Signal, Tick
from labcrane_gateway.settings import GatewaySettings

if TYPE_CHECKING:
    import pylsl

FULL = 250.0
FLOW_HZ = 50.0
MOST_A_TICK = 64
"""Samples taken in one tick; a station that sends more is read on in the next."""

LOOK_S = 0.2
"""Time between looks for the station's stream, in a thread of their own: they may take long."""


class Station(InputDevice):
    """Takes the newest sample of the command stream; an old one shuts all valves.

    Age counts from the arrival here, so that nothing depends on the other computer's clock.
    """

    def __init__(self, settings: GatewaySettings, machine: Machine) -> None:
        self.signals = (Signal("valve", "1", machine.names), Signal("panel.connected", "1"))
        self._settings = settings
        self._joints = machine.names
        self._out = np.zeros(len(machine.names) + 1)
        self._signals = [0.0] * len(machine.names)
        self._came = -math.inf
        self._complaint = ""
        self._inlet: pylsl.StreamInlet | None = None
        self._order: list[int] = []
        self._outlet: pylsl.StreamOutlet | None = None
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self, run: Run) -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        names = [signal.name for signal in run.state.signals]
        self._opening = run.state.find("valve.opening") if "valve.opening" in names else None
        self._every = max(1, round(run.rate_hz / FLOW_HZ))
        info = pylsl.StreamInfo(
            self._settings.flow, "Control", len(self._joints), 0.0, "float32", "labcrane/gateway"
        )
        channels = info.desc().append_child("channels")
        for joint in self._joints:
            channel = channels.append_child("channel")
            channel.append_child_value("label", joint)
            channel.append_child_value("unit", "0.4 percent")
        self._outlet = pylsl.StreamOutlet(info)
        self._thread = threading.Thread(target=self._look, name="labcrane-gateway", daemon=True)
        self._thread.start()

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        self._pull(tick.woke)
        age = tick.woke - self._came
        out = self._out
        if age > self._settings.timeout_s:
            self.fault = (
                f"no command in stream {self._settings.stream!r} for "
                f"{self._settings.timeout_s:g} s"
                + (f"; {self._complaint}" if self._complaint else "")
            )
            out[:] = 0.0
        else:
            self.fault = None
            out[:-1] = [signal / FULL for signal in self._signals]
            out[-1] = 1.0
        if self._outlet is not None and self._opening is not None and not tick.number % self._every:
            self._outlet.push_sample(seen.state[self._opening].tolist(), tick.due)
        return out

    def close(self) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._inlet = self._outlet = None

    def _pull(self, now: float) -> None:
        inlet = self._inlet
        if inlet is None:
            return
        newest: Sequence[float] | None = None
        for _ in range(MOST_A_TICK):
            sample, stamp = inlet.pull_sample(timeout=0.0)
            if stamp is None:
                break
            newest = sample
        if newest is None:
            return
        signals = [newest[place] for place in self._order]
        wrong = [signal for signal in signals if not abs(signal) <= FULL]
        if wrong:
            self._complaint = (
                f"its last sample was refused, because {wrong[0]:g} is not within -250 to 250"
            )
            return
        self._signals = [float(round(signal)) for signal in signals]
        self._came, self._complaint = now, ""

    def _look(self) -> None:
        import pylsl  # noqa: PLC0415

        while not self._over.is_set():
            if self._inlet is None:
                found = pylsl.resolve_byprop("name", self._settings.stream, timeout=LOOK_S)
                if found:
                    self._take(pylsl.StreamInlet(found[0], max_buflen=2, recover=True))
            self._over.wait(LOOK_S)

    def _take(self, inlet: "pylsl.StreamInlet") -> None:
        import pylsl  # noqa: PLC0415

        try:
            info = inlet.info(timeout=2.0)
            labels = info.get_channel_labels() or []
            inlet.open_stream(timeout=2.0)
        except (
            pylsl.util.TimeoutError,
            pylsl.util.LostError,
        ) as error:
            self._complaint = f"it was there and is gone again ({error})"
            return
        if info.channel_format() == pylsl.cf_string or len(labels) > info.channel_count():
            self._complaint = (
                f"it has {info.channel_count()} channels of format {info.channel_format()}, and "
                f"{len(labels)} names; send numbers, and a name for each channel"
            )
            return
        if missing := [joint for joint in self._joints if joint not in labels]:
            self._complaint = (
                f"its channels are {', '.join(map(str, labels)) or 'not named'}; the machine also "
                f"needs {', '.join(missing)}"
            )
            return
        self._order = [labels.index(joint) for joint in self._joints]
        self._inlet = inlet
