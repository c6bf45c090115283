"""A control station that speaks the open gateway protocol (docs/gateway.md)."""

import math
from typing import TYPE_CHECKING

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Machine, Run, Signal, StreamError, Tick
from labcrane.streams import NewestSample, numeric_labels
from labcrane_gateway.settings import GatewaySettings

if TYPE_CHECKING:
    import pylsl

FULL = 250.0
FLOW_HZ = 50.0


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
        self._order: list[int] = []
        self._outlet: pylsl.StreamOutlet | None = None
        self._station: NewestSample | None = None

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
        self._station = NewestSample({"name": self._settings.stream}, self._accept)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        self._pull(tick.woke)
        age = tick.woke - self._came
        out = self._out
        if age > self._settings.timeout_s:
            self.fault = (
                f"no command in stream {self._settings.stream!r} for "
                f"{self._settings.timeout_s:g} s" + (f"; {why}" if (why := self._trouble()) else "")
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
        if self._station is not None:
            self._station.close()
            self._station = None
        self._outlet = None

    def _trouble(self) -> str:
        return self._complaint or (self._station.complaint if self._station else "")

    def _pull(self, now: float) -> None:
        newest = None if self._station is None else self._station.newest()
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

    def _accept(self, info: "pylsl.StreamInfo") -> None:
        """Take where each joint's command is in a station's stream."""
        labels = numeric_labels(info)
        if missing := [joint for joint in self._joints if joint not in labels]:
            raise StreamError(
                f"its channels are {', '.join(labels) or 'not named'}; the machine also needs "
                f"{', '.join(missing)}"
            )
        self._order = [labels.index(joint) for joint in self._joints]
