"""Parallel port as a line, through the kernel's ppdev. Not tried on a real one."""

import os
import struct
import sys
from collections.abc import Callable, Sequence

from labcrane import DeviceError, Run, Trigger
from labcrane.core import Echo
from labcrane_ttl.pulse import Pulse
from labcrane_ttl.settings import ParallelSettings

CLAIM, RELEASE, WRITE = 0x708B, 0x708C, 0x40017086
"""Requests of linux/ppdev.h: PPCLAIM, PPRELEASE and PPWDATA."""

Control = Callable[[int, int, bytes], object]


class ParallelTrigger(Trigger):
    """Puts codes on the eight data lines, and clears them when a pulse is over.

    Parameters
    ----------
    control
        Calls the kernel; ``fcntl.ioctl`` by default.
    """

    def __init__(self, settings: ParallelSettings, control: Control | None = None) -> None:
        self.codes, self.spacing_s = settings.codes, settings.spacing_s
        self._path = settings.port
        self._pulse = Pulse(settings.pulse_s)
        self._control = control
        self._file: int | None = None

    def open(self, run: Run) -> None:
        if self._control is None:
            self._control = _ioctl()
        try:
            self._file = os.open(self._path, os.O_RDWR)
            self._control(self._file, CLAIM, b"")
        except OSError as error:
            raise DeviceError(
                f"the parallel port {self._path} cannot be opened: {error}; modprobe ppdev, and "
                "be in the group lp"
            ) from error

    def send(self, codes: Sequence[int], now: float) -> Sequence[Echo]:
        for code in codes:
            self._put(code)
            self._pulse.begin(now)
        if not codes and self._pulse.is_over(now):
            self._put(0)
        return ()

    def close(self) -> None:
        if self._file is None:
            return
        self._put(0)
        os.close(self._file)  # which releases it
        self._file = None

    def _put(self, code: int) -> None:
        if self._file is None or self._control is None:
            return
        try:
            self._control(self._file, WRITE, struct.pack("B", code))
            self.fault = None
        except OSError as error:
            self.fault = f"{self._path} cannot be written: {error}"


if sys.platform == "linux":

    def _ioctl() -> Control:
        from fcntl import ioctl

        return ioctl

else:

    def _ioctl() -> Control:
        raise DeviceError("parallel ports are for Linux; elsewhere use serial_ttl or box_ttl")
