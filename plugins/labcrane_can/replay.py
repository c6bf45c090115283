"""A recorded bus as an input device."""

from collections.abc import Mapping, Sequence

import numpy as np

from labcrane import FloatArray, Frame, InputDevice, Machine, ProtocolError, Run, Tick
from labcrane.core import Value
from labcrane_can.axes import PanelAxes
from labcrane_can.command_state import PanelCommands
from labcrane_can.log_file import read_log
from labcrane_can.settings import ReplaySettings

MICROSECONDS = 6
"""Digits of a time that all formats keep; further digits differ between them."""


BACK_S = 0.01
"""Time by which a frame's timestamp may precede that of the frame before: drivers reorder
frames."""


def times_of(stamps: Sequence[float], *, relative: bool) -> list[float]:
    """Return the time of each frame from the first one on, in seconds.

    Parameters
    ----------
    relative
        Whether each is counted from the frame before it, as an asc log may say.
    """
    times = np.cumsum(stamps) if relative else np.asarray(stamps)
    return [round(float(time - times[0]), MICROSECONDS) for time in times]


class CanReplay(InputDevice):
    """Gives in each tick the commands that had come by then, counted from the log's first frame.

    Time is that of the log and of the ticks alone, so the same log gives the same commands on every
    computer. When the log has ended the panel is lost.
    """

    def __init__(self, settings: ReplaySettings, machine: Machine) -> None:
        self._axes = PanelAxes(settings, machine)
        self.signals = self._axes.signals
        self._settings = settings
        self._frames, relative, self._torn = read_log(settings.file, settings.bus)
        if not self._frames:
            raise ProtocolError(f"{settings.file} holds no frames, so there is nothing to replay")
        self._times = times_of([frame.timestamp for frame in self._frames], relative=relative)
        back = np.diff(self._times)
        if len(back) and back.min() < -BACK_S:
            at = int(back.argmin()) + 1
            raise ProtocolError(
                f"the clock of {settings.file} goes back by {-back[at - 1]:g} s at its frame "
                f"{at + 1}, so the times of all later frames are unknown; cut the log there"
            )

    def open(self, run: Run) -> None:
        self._rate_hz = run.rate_hz
        self._next = 0
        self._commands = PanelCommands(self._settings)

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        now = tick.number / self._rate_hz
        while self._next < len(self._frames):
            frame = self._frames[self._next]
            at = self._times[self._next]
            if at > now:
                break
            self._commands.take(frame, at)
            self._next += 1
        signals, floats, there = self._commands.signals(now)
        if not there:
            ended = self._next == len(self._frames)
            self.fault = (
                f"the log {self._settings.file} has ended"
                if ended
                else f"no valve command for {self._settings.timeout_s:g} s at {now:.3f} s of it"
            )
        else:
            self.fault = self._commands.silent(now)
        if self.fault is not None:
            return self._axes.lost()
        return self._axes.given(signals, floats)

    def metadata(self) -> Mapping[str, Value]:
        about: dict[str, Value] = {"file": self._settings.file.name, "frames": len(self._frames)}
        return about | {"torn": self._torn} if self._torn else about
