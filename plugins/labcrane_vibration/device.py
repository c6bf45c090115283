"""Devices that vibrate: tactors that take lines of text, and a game controller.

A line of text sets all tactors: ``V 17 128 0``, with the command's number and a level from 0 to 255
for each. The device answers with the number, its own microseconds, and how many tactors it has:
``E 17 5123044 4``. It stops by itself when no line has come for 200 ms. ``tactors.ino`` beside this
file is such a device.
"""

import os
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

from labcrane import DeviceError
from labcrane.core import Finding, Verdict
from labcrane_vibration.settings import VibrationSettings

TOP = 255
"""Level of the largest amplitude."""

AGAIN_S = 0.05
"""Time after which a level is sent again, as the device stops by itself."""

ANSWER_S, START_S = 1.0, 4.0
"""Longest time without an answer, in a session and at the start: a board restarts when its port is
opened, and needs two seconds for it."""

FEW = 3
"""Commands without an answer that are a lost datagram or two, and not a lost device."""

WRITE_S = 0.1
LISTEN_S = 0.05
LONGEST, DATAGRAM = 64, 4096
"""Bytes of the longest answer, and of a datagram with several of them."""

PULSE_MS = 200
"""How long a controller rumbles when it is not told again."""

DIGITS = 10
"""Digits of the longest number in an answer."""

UNFELT = 1e-4
"""Level that no motor moves at."""

Answer = tuple[float, float, float]
"""A command's number, seconds from its sending to its answer, and the device's own seconds."""


class Device(ABC):
    """Tactors, and their last levels.

    Attributes
    ----------
    name
        What it is, in words.
    levels
        Of each tactor, the last one that was sent, 0 to 1.
    number
        Number of the last command.
    soonest_s
        Shortest time from a command to the next, in seconds.
    """

    soonest_s = 0.01

    def __init__(self, tactors: int, name: str) -> None:
        self.name = name
        self.levels: tuple[float, ...] = (0.0,) * tactors
        self.number = 0
        self._sent = -1.0

    def begin(self) -> None:
        """Make sure that it is there; raises :class:`DeviceError` if not."""

    def set(self, levels: Sequence[float]) -> None:
        """Tell the tactors their levels, 0 to 1, unless they know them; zeros go out at once."""
        now, wanted = time.perf_counter(), tuple(levels)
        soon = self.soonest_s if wanted != self.levels else AGAIN_S
        if now - self._sent < soon and (any(wanted) or wanted == self.levels):
            return
        self.levels, self._sent = wanted, now
        self.number += 1
        self.send([round(TOP * level) for level in wanted])

    def answers(self) -> list[Answer]:
        """Return the answers that have come since the last call."""
        return []

    @abstractmethod
    def send(self, levels: Sequence[int]) -> None:
        """Send levels, 0 to 255."""

    def close(self) -> None:
        """Stop all tactors."""


class Line(Device):
    """Tactors that take lines of text and answer each."""

    def __init__(self, tactors: int, name: str) -> None:
        super().__init__(tactors, name)
        self._times: dict[int, float] = {}
        self._answers: deque[Answer] = deque()
        self._broken = ""
        self._there = 0
        self._closing = threading.Event()
        self._listener = threading.Thread(target=self._listen, daemon=True)

    def begin(self) -> None:
        self._listener.start()
        began = time.perf_counter()
        while not self._answers:
            self.number += 1
            self._tell([0] * len(self.levels))
            if time.perf_counter() - began > START_S:
                self.close()
                raise DeviceError(
                    f"the tactors at {self.name} do not answer; load tactors.ino onto the board "
                    "(docs/touch.md), and correct port, baud or address"
                )
            time.sleep(LISTEN_S)
        if self._there < len(self.levels):
            self.close()
            raise DeviceError(
                f"tactors: names {len(self.levels)}, and the board at {self.name} has "
                f"{self._there}; name fewer, or add pins to tactors.ino"
            )

    def send(self, levels: Sequence[int]) -> None:
        unanswered = list(self._times.values())
        silent = len(unanswered) > FEW and time.perf_counter() - min(unanswered) > ANSWER_S
        if self._broken or silent:
            said = self._broken or f"they have not answered for {ANSWER_S:g} s"
            raise DeviceError(f"the tactors at {self.name} are lost: {said}; connect them again")
        self._tell(levels)

    def _tell(self, levels: Sequence[int]) -> None:
        self._times[self.number] = time.perf_counter()
        try:
            self.write(f"V {self.number} {' '.join(map(str, levels))}\n".encode())
        except OSError as error:  # a serial port that takes no more raises one, too
            raise DeviceError(
                f"the tactors at {self.name} are lost: {error}; connect them again"
            ) from error

    def answers(self) -> list[Answer]:
        return [self._answers.popleft() for _ in range(len(self._answers))]

    def close(self) -> None:
        if self.levels and not self._broken:
            self.number += 1
            with suppress(OSError):  # what is gone stops by itself
                self.write(f"V {self.number}{' 0' * len(self.levels)}\n".encode())
        self._closing.set()
        if self._listener.is_alive():
            self._listener.join()

    @abstractmethod
    def write(self, line: bytes) -> None:
        """Write a line; raises OSError."""

    @abstractmethod
    def read(self) -> bytes:
        """Return what has come, after :data:`LISTEN_S` at the latest; raises OSError."""

    def _listen(self) -> None:
        rest = b""
        while not self._closing.is_set():
            try:
                came = self.read()
            except (OSError, TypeError) as error:  # gone, or closed under it
                self._broken = str(error)
                return
            now = time.perf_counter()
            *lines, rest = (rest + came).split(b"\n")
            rest = rest[-LONGEST:]
            for line in lines:
                self._take(line.split(), now)

    def _take(self, words: Sequence[bytes], now: float) -> None:
        """Take an answer; what is none, as the noise of a board that starts, is left out."""
        if len(words) != 4 or words[0] != b"E":  # noqa: PLR2004
            return
        if not all(word.isdigit() and len(word) <= DIGITS for word in words[1:]):
            return
        number, micros, self._there = (int(word) for word in words[1:])
        if (sent := self._times.pop(number, None)) is None:
            return
        for unanswered in [each for each in list(self._times) if each < number]:
            del self._times[unanswered]
        self._answers.append((float(number), now - sent, micros / 1e6))


class SerialTactors(Line):
    """Tactors on a serial port."""

    def __init__(self, settings: VibrationSettings) -> None:
        try:
            import serial  # noqa: PLC0415
        except ImportError as error:
            raise DeviceError(
                "driver: serial needs pyserial, which is not installed; pip install 'labcrane[lab]'"
            ) from error
        super().__init__(len(settings.tactors), str(settings.port))
        try:
            self._port = serial.Serial(
                settings.port,
                settings.baud,
                timeout=LISTEN_S,
                write_timeout=WRITE_S,
                exclusive=True,
            )
        except (OSError, ValueError) as error:
            raise DeviceError(
                f"the serial port {settings.port!r} cannot be opened: {error}; plug the tactors "
                "in, or correct port:"
            ) from error

    def write(self, line: bytes) -> None:
        self._port.write(line)

    def read(self) -> bytes:
        came = bytes(self._port.read(1))
        return came + bytes(self._port.read(self._port.in_waiting)) if came else b""

    def close(self) -> None:
        super().close()
        self._port.close()


class UdpTactors(Line):
    """Tactors that take the same lines as datagrams."""

    def __init__(self, settings: VibrationSettings) -> None:
        address = str(settings.address)
        super().__init__(len(settings.tactors), address)
        host, _, port = address.rpartition(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(LISTEN_S)
        try:
            self._socket.connect((host, int(port)))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise DeviceError(
                f"the tactors at {address} cannot be reached: {error}; correct address:"
            ) from error

    def write(self, line: bytes) -> None:
        with suppress(ConnectionRefusedError):  # of an earlier line; its answer is missing
            self._socket.send(line)

    def read(self) -> bytes:
        try:
            return self._socket.recv(DATAGRAM)
        except TimeoutError:
            return b""
        except ConnectionRefusedError:
            self._closing.wait(LISTEN_S)
            return b""

    def close(self) -> None:
        super().close()
        self._socket.close()


class Rumble(Device):
    """The motors of a game controller: it has one or two tactors, and no answers.

    SDL ends a rumble only while it is asked for events, so a thread ends one that is not renewed.
    """

    def __init__(self, settings: VibrationSettings) -> None:
        super().__init__(len(settings.tactors), f"controller {settings.stick}")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
        try:
            import pygame.joystick  # noqa: PLC0415
        except ImportError as error:
            raise DeviceError(
                "driver: rumble needs pygame, which is not installed; pip install 'labcrane[lab]'"
            ) from error
        self._library = pygame.joystick
        self._library.init()
        there, number = self._library.get_count(), settings.stick
        if number > there:
            self._library.quit()
            raise DeviceError(
                f"stick: {number} was asked for, and there are {there} controllers; plug it in, "
                "or correct stick:"
            )
        self._stick = self._library.Joystick(number - 1)
        self.name += f" ({self._stick.get_name()})"
        self._lock, self._closing = threading.Lock(), threading.Event()
        self._watch = threading.Thread(target=self._stop_if_silent, daemon=True)

    def begin(self) -> None:
        self._rumble(UNFELT, UNFELT)  # SDL accepts zeros of a controller without motors
        self._stick.stop_rumble()
        self._watch.start()

    def send(self, levels: Sequence[int]) -> None:
        self._rumble(levels[0] / TOP, levels[-1] / TOP)

    def _rumble(self, heavy: float, light: float) -> None:
        with self._lock:
            self._ends = time.perf_counter() + 1e-3 * PULSE_MS
            if not self._stick.rumble(heavy, light, PULSE_MS):
                raise DeviceError(
                    f"{self.name} does not rumble; connect one that does, or use tactors"
                )

    def _stop_if_silent(self) -> None:
        while not self._closing.wait(LISTEN_S):
            with self._lock:
                if time.perf_counter() > self._ends:
                    self._stick.stop_rumble()

    def close(self) -> None:
        self._closing.set()
        if self._watch.is_alive():
            self._watch.join()
        self._stick.stop_rumble()
        self._library.quit()


DRIVERS: Mapping[str, Callable[[VibrationSettings], Device]] = {
    "serial": SerialTactors, "udp": UdpTactors, "rumble": Rumble,
}  # fmt: skip


def opened(settings: VibrationSettings) -> Device:
    """Return the device, which has answered.

    Raises
    ------
    DeviceError
        It is not there, or does not answer.
    """
    device = DRIVERS[settings.driver](settings)
    device.begin()
    return device


def examine(settings: VibrationSettings) -> list[Finding]:
    """Open the device as a session would, without any vibration, and close it."""
    try:
        device = opened(settings)
    except DeviceError as error:
        return [Finding.failed(error)]
    delays = [f"; it answered within {1e3 * delay:.1f} ms" for _, delay, _ in device.answers()]
    device.close()
    text = f"{device.name} has {len(settings.tactors)} tactors{''.join(delays[-1:])}"
    return [Finding(Verdict.PASS, text)]
