"""A control panel on a CAN bus as an input device."""

from collections.abc import Mapping

from labcrane import FloatArray, Frame, InputDevice, Machine, Run, Tick
from labcrane.core import Value
from labcrane_can.avc import ESTIMATED, FULL, MEASURED, encode_flow
from labcrane_can.axes import PanelAxes
from labcrane_can.command_state import PanelCommands
from labcrane_can.listener import Listener
from labcrane_can.settings import CanSettings

FEEDBACK_HZ = 10.0
PERCENT = 100.0


class CanPanel(InputDevice):
    """Reads the newest command of every valve; an expired command shuts the valve.

    A thread reads the frames, so that a slow adapter never delays the loop.
    """

    def __init__(self, settings: CanSettings, machine: Machine) -> None:
        self._axes = PanelAxes(settings, machine)
        self.signals = self._axes.signals
        self._settings = settings
        self._machine = machine
        self._commands = PanelCommands(settings)
        self._listener: Listener | None = None

    def open(self, run: Run) -> None:
        names = [signal.name for signal in run.state.signals]
        self._opening = run.state.find("valve.opening") if "valve.opening" in names else None
        self._speed = run.state.find("joint.velocity")
        self._places = {joint: self._machine.names.index(joint) for joint in self._settings.valves}
        self._every = max(1, round(run.rate_hz / FEEDBACK_HZ))
        self._listener = Listener(self._settings, self._commands)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        signals, floats, there = self._commands.signals(tick.woke)
        self.fault = self._trouble(tick.woke, there=there)
        if self.fault is not None:
            return self._axes.lost()
        if self._settings.feedback and tick.number % self._every == 0:
            self._send_back(seen.state)
        return self._axes.given(signals, floats)

    def close(self) -> None:
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def metadata(self) -> Mapping[str, Value]:
        from importlib.metadata import version  # noqa: PLC0415 - only in a session

        return {"bus": self._settings.bus, "python-can": version("python-can")}

    def _trouble(self, now: float, *, there: bool) -> str | None:
        if self._listener is not None and self._listener.lost is not None:
            return self._listener.lost
        if there:
            return self._commands.silent(now)
        complaint = self._commands.complaint()
        return f"no valve command for {self._settings.timeout_s:g} s on {self._settings.bus}" + (
            f"; {complaint}" if complaint else ""
        )

    def _send_back(self, state: FloatArray) -> None:
        listener = self._listener
        if listener is None or self._opening is None:
            return
        openings, speeds = state[self._opening].tolist(), state[self._speed].tolist()
        for joint, place in self._places.items():
            valve = self._settings.valves[joint]
            if not isinstance(valve, int):
                return  # a DBC map does not describe the messages that the panel expects
            estimated = PERCENT * openings[place] / FULL
            measured = PERCENT * speeds[place] / self._machine.speeds[place]
            listener.send(*encode_flow(ESTIMATED, valve, estimated))
            listener.send(*encode_flow(MEASURED, valve, measured))
