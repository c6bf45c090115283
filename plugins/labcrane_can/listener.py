"""A thread that reads a bus independently of the loop, and reopens it after a disconnection."""

import contextlib
import socket
import threading
import time
from collections import deque
from typing import TYPE_CHECKING, Any

from labcrane import DeviceError
from labcrane_can.command_state import PanelCommands
from labcrane_can.settings import CanSettings

if TYPE_CHECKING:
    import can

WAIT_S = 0.02
"""Maximum duration of one read from the bus; outgoing frames wait as long."""

DIAL_AFTER_S, DIAL_S = 1.0, 0.5
"""Silence after which a socketcand server is connected again, and the limit for connecting."""

MOST_GARBLED = 20
"""Number of consecutive lines that are not frames, after which the bus is opened again."""

MOST_FRAMES_S = 4000
"""Frames per second above which the bus counts as flooded: about twice what 250 kbit/s carry."""

AGAIN_S = 0.2
"""Time between attempts to open a bus that was lost."""


class Listener:
    """Read frames into a panel's commands, and send frames.

    Attributes
    ----------
    lost
        Why the bus cannot be read, in words; None while it can.
    """

    def __init__(self, settings: CanSettings, commands: PanelCommands) -> None:
        self.lost: str | None = None
        self._settings = settings
        self._commands = commands
        self._outgoing: deque[can.Message] = deque(maxlen=64)
        self._over = threading.Event()
        self._second, self._count = 0.0, 0
        self._flooded = False
        self._heard, self._garbled = time.perf_counter(), 0
        self._bus: can.BusABC | None = open_bus(settings)
        self._thread = threading.Thread(target=self._work, name="labcrane-can", daemon=True)
        self._thread.start()

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame soon; the oldest are left out when the bus does not take them."""
        import can  # noqa: PLC0415

        self._outgoing.append(can.Message(arbitration_id=identifier, data=data))

    def close(self) -> None:
        """Stop reading, and free the bus."""
        self._over.set()
        self._thread.join()
        self._shut()

    def _work(self) -> None:
        """Read until the end; report every failure of the bus, and open the bus again."""
        while not self._over.is_set():
            try:
                self._read()
            except Exception as error:  # noqa: BLE001 - a dead thread would leave the panel dead
                self._shut()
                self.lost = f"what {self._settings.bus} brought cannot be read: {error!r}"
                self._over.wait(AGAIN_S)

    def _read(self) -> None:
        import can  # noqa: PLC0415

        while not self._over.is_set():
            if self._bus is None:
                self._reopen()
                continue
            try:
                while self._outgoing:
                    self._bus.send(self._outgoing.popleft(), timeout=WAIT_S)
                frame = self._look(self._bus)
                self._watch_end(came=frame is not None)
            except (can.CanError, OSError, TypeError) as error:
                # pyserial raises various errors when its file is closed during a read.
                self._shut()
                self.lost = f"{self._settings.bus} is gone: {error}"
                continue
            now = time.perf_counter()
            if frame is not None:
                self._commands.take(frame, now)
            self._watch_flood(now, came=frame is not None)

    def _look(self, bus: "can.BusABC") -> "can.Message | None":
        """Return the next frame; what an adapter garbled is refused, and it goes on."""
        try:
            frame = bus.recv(WAIT_S)
        except (ValueError, IndexError) as error:
            self._garbled += 1
            if self._garbled > MOST_GARBLED:
                raise OSError(f"{MOST_GARBLED} lines in a row are not frames ({error})") from error
            self._commands.refuse(f"the adapter's line is not a frame ({error})")
            return None
        self._garbled = 0 if frame is not None else self._garbled
        return frame

    def _watch_end(self, *, came: bool) -> None:
        # python-can 4.6 does not report that a socketcand server has closed: no data come.
        now = time.perf_counter()
        if came or not self._settings.bus.startswith("socketcand:"):
            self._heard = now
        elif now - self._heard > DIAL_AFTER_S:
            self._heard = now
            raise OSError(f"no data came for {DIAL_AFTER_S:g} s; the connection is being reopened")

    def _watch_flood(self, now: float, *, came: bool) -> None:
        self._count += came
        if now - self._second < 1.0:
            return
        rate = self._count / (now - self._second) if self._second else 0.0
        self._second, self._count = now, 0
        if rate > MOST_FRAMES_S:
            self.lost = (
                f"{self._settings.bus} is flooded: {rate:.0f} frames a second, where "
                f"{MOST_FRAMES_S} are the most; find out who sends them"
            )
            self._flooded = True
        elif self._flooded:
            self.lost, self._flooded = None, False

    def _reopen(self) -> None:
        try:
            self._bus = open_bus(self._settings)
        except DeviceError:
            self._over.wait(AGAIN_S)
        else:
            self._commands.forget()
            self.lost = None

    def _shut(self) -> None:
        if self._bus is not None:
            bus, self._bus = self._bus, None
            with contextlib.suppress(Exception):  # an unplugged bus cannot be closed properly
                bus.shutdown()


def open_bus(settings: CanSettings) -> "can.BusABC":
    """Open the bus that the settings name.

    Raises
    ------
    DeviceError
        python-can cannot open it; says why.
    """
    import can  # noqa: PLC0415

    interface, _, channel = settings.bus.partition(":")
    options: dict[str, Any] = {}
    if interface == "slcan":
        options["sleep_after_open"] = 0.0
    if interface == "socketcand":
        channel, _, where = channel.partition("@")
        host, _, port = where.partition(":")
        options |= {"host": host or "127.0.0.1", "port": int(port or 29536)}
    try:
        if interface == "socketcand":
            # python-can tries for 10 s without a pause, which would slow the loop down.
            socket.create_connection((options["host"], options["port"]), DIAL_S).close()
        return can.Bus(interface=interface, channel=channel, bitrate=settings.bitrate, **options)
    except Exception as error:
        raise DeviceError(
            f"bus {settings.bus!r} cannot be opened: {error}; plug the adapter in, and check name "
            "and permissions"
        ) from error
