"""Overruns: reports of components that take longer than a tick.

Whether one computed for so long, or waited while another program had the processor, is told apart.
"""

from labcrane.core.records import Event, Frame
from labcrane.recording.frame_log import FrameLog
from labcrane.registry.call_monitor import CallMonitor, Overrun
from labcrane.session.commands import Console

FEW = 3
"""Overruns of one method within a second that may be the computer's: another process had it."""

AGAIN_S = 60.0
"""Seconds between two reports of a component that stays slow."""


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
                    "why": self._why(str(place), overrun),
                    "calls": overrun.calls,
                    "waited": overrun.waited,
                    "worst_s": overrun.worst_s,
                    "computed_s": overrun.computed_s,
                    "tick_s": self._period,
                },
            )
            self._log.append(event, frame.tick.number)
            self._console.report(event)
        self._call_monitor.overruns.clear()

    def _why(self, place: str, overrun: Overrun) -> str:
        took, tick = 1000 * overrun.worst_s, 1000 * self._period
        computed = overrun.calls - overrun.waited
        # The longest call alone would excuse a component that computes for too long in all others.
        found = [f"{computed} computed for too long"] if computed else []
        if overrun.waited:
            found.append(
                f"{overrun.waited} waited for a device, or for the processor that other programs "
                "had"
            )
        return (
            f"{place}, took up to {took:.0f} ms, and a tick has {tick:.1f} ms; of {overrun.calls} "
            f"such calls {' and '.join(found)}"
        )
