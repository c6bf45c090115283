"""Serial port as a line: bytes are sent in the tick, echoes get a timestamp on arrival."""

import math
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from labcrane import DeviceError, Run, Trigger
from labcrane.core import Echo
from labcrane_ttl.pulse import Pulse
from labcrane_ttl.settings import SerialSettings

if TYPE_CHECKING:
    import serial

LISTEN_S = 0.1
"""Longest time that a close waits for the one who listens."""

AT_ONCE = 4096
"""Bytes that are taken off the port at once."""

FLOOD, REST_S = 64, 0.005
"""So many bytes at once are not echoes: the listener then rests, so that the loop can run."""

KEPT = 1024
"""Echoes that wait for a tick; of a flood the newest stay."""


def as_byte(code: int) -> bytes:
    """Return a code as the byte that it is."""
    return bytes([code])


class SerialTrigger(Trigger):
    """Writes codes to a serial port, and clears the lines when a pulse is over.

    Parameters
    ----------
    written
        What is written for a code.
    rest
        What clears the lines.
    """

    def __init__(
        self, settings: SerialSettings, written: Callable[[int], bytes], rest: bytes
    ) -> None:
        self.codes, self.spacing_s = settings.codes, settings.spacing_s
        self._settings = settings
        self._written = written
        self._rest = rest
        self._pulse = Pulse(settings.pulse_s)
        self._port: serial.Serial | None = None
        self._echoes: deque[Echo] = deque(maxlen=KEPT)
        self._listener: threading.Thread | None = None
        self._deaf: str | None = None
        self._closing = threading.Event()

    def open(self, run: Run) -> None:
        import serial

        name = self._settings.port
        try:
            self._port = serial.Serial(
                name, self._settings.baud, timeout=LISTEN_S, write_timeout=0, exclusive=True
            )
            self._port.reset_input_buffer()
        except (OSError, ValueError) as error:
            raise DeviceError(
                f"the serial port {name!r} cannot be opened: {error}; plug it in, or correct port:"
            ) from error
        self._closing.clear()
        if self._settings.echo:
            self._listener = threading.Thread(target=self._listen, args=(self._port,), daemon=True)
            self._listener.start()

    def send(self, codes: Sequence[int], now: float) -> Sequence[Echo]:
        if self._port is None:
            return ()
        if codes:
            self._write(b"".join(map(self._written, codes)))
            self._pulse.begin(now)
        elif self._pulse.is_over(now):
            self._write(self._rest)
        if self._listener is None:
            return ()
        if self._deaf is not None:
            self.fault = self._deaf
        return [self._echoes.popleft() for _ in range(len(self._echoes))]

    def close(self) -> None:
        self._closing.set()
        if self._pulse.is_over(math.inf):  # no line stays up behind a session
            self._write(self._rest)
        if self._listener is not None:
            self._listener.join()
        if self._port is not None:
            self._port.close()
        self._port = self._listener = None

    def _write(self, content: bytes) -> None:
        name = self._settings.port
        if self._port is None:
            return
        try:
            if _put(self._port, content) == len(content):
                self.fault = self._deaf
            else:
                self.fault = f"{name} takes no more: its device does not read"
        except OSError as error:
            self.fault = f"{name} cannot be written: {error}; plug it in, and end and resume"

    def _listen(self, port: "serial.Serial") -> None:
        while not self._closing.is_set():
            try:
                came = port.read(1)
                if came:
                    came += port.read(min(port.in_waiting, AT_ONCE))
            except (OSError, TypeError) as error:  # gone, or closed under it
                self._deaf = f"{self._settings.port} cannot be read: {error}"
                return
            now = time.perf_counter()
            # A zero is the echo of a line that was cleared.
            self._echoes.extend(Echo(code, now) for code in came[-KEPT:] if code)
            if len(came) > FLOOD:
                self._closing.wait(REST_S)


if sys.platform == "win32":

    def _put(port: "serial.Serial", content: bytes) -> int:
        """Hand over bytes without waiting; return how many were taken."""
        return int(port.write(content) or 0)
else:

    def _put(port: "serial.Serial", content: bytes) -> int:
        """Hand over bytes without waiting; return how many were taken.

        pyserial's own ``write`` never returns while the buffer of a port that must not wait is
        full.
        """
        try:
            return os.write(port.fileno(), content)
        except BlockingIOError:
            return 0
