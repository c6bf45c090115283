"""Overruns: components that take longer than a tick has, and are told of."""

from labcrane.core.records import Event, Frame
from labcrane.recording.frame_log import FrameLog
from labcrane.registry.call_monitor import CallMonitor
from labcrane.session.commands import Console

FEW = 3
"""Overruns of one method within a second that may be the computer's: another process had it."""

AGAIN_S = 60.0
"""A component that stays slow is told of this often."""


class OverrunReporter:
    """Looks once a second which components were slow, and notes it as an event."""

    def __init__(
        self, call_monitor: CallMonitor, rate_hz: float, log: FrameLog, console: Console
    ) -> None:
        self._call_monitor = call_monitor
        self._log = log
        self._console = console
        self._period = call_monitor.patience_s = 1.0 / rate_hz
        self._look_at = 0.0
        self._told: dict[object, float] = {}

    def __call__(self, frame: Frame) -> None:
        now = frame.tick.woke
        if now < self._look_at:
            return
        self._look_at = now + 1.0
        for place, overrun in self._call_monitor.overruns.items():
            if overrun.calls <= FEW or now < self._told.get(place, 0.0):
                continue
            self._told[place] = now + AGAIN_S
            event = Event(
                "plugin.slow",
                frame.tick.due,
                {
                    "why": f"{place}, took up to {1000 * overrun.worst_s:.0f} ms, and a tick has "
                    f"{1000 * self._period:.1f} ms",
                    "calls": overrun.calls,
                    "worst_s": overrun.worst_s,
                    "tick_s": self._period,
                },
            )
            self._log.append(event, frame.tick.number)
            self._console.report(event)
        self._call_monitor.overruns.clear()
