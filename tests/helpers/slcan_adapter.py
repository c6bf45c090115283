"""An slcan (Lawicel) adapter made of a pty: no kernel CAN needed."""

import os
import pty
import select
import threading
import tty
from pathlib import Path


class SlcanAdapter:
    """The near side opens ``path``; the far side puts frames on the bus with :meth:`send`.

    Frames that the near side sends are kept in ``sent``.
    """

    def __init__(self, path: str | None = None) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        if path is not None:  # what a udev rule does: the same name after a re-plug
            Path(path).unlink(missing_ok=True)
            Path(path).symlink_to(self.path)
            self.path = path
        self.opened = False
        self.sent: list[tuple[int, bytes]] = []
        self._wake, self._waker = os.pipe()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def send(self, identifier: int, data: bytes) -> None:
        if self.opened:  # a real adapter drops frames while its channel is closed
            text = f"T{identifier:08X}{len(data)}{data.hex().upper()}\r"
            os.write(self._master, text.encode())

    def garble(self, text: bytes) -> None:
        os.write(self._master, text)

    def unplug(self) -> None:
        os.write(self._waker, b"x")
        self._thread.join()
        for handle in (self._slave, self._master, self._wake, self._waker):
            os.close(handle)

    def _work(self) -> None:
        waiting = b""
        while True:
            ready, _, _ = select.select([self._master, self._wake], [], [])
            if self._wake in ready:
                return
            waiting += os.read(self._master, 4096)
            *commands, waiting = waiting.split(b"\r")
            for command in commands:
                self._obey(command.decode("ascii", "replace"))

    def _obey(self, command: str) -> None:
        answer = b"\r"
        match command[:1]:
            case "O":
                self.opened = True
            case "C":
                self.opened = False
            case "T":
                length = int(command[9])
                self.sent.append(
                    (int(command[1:9], 16), bytes.fromhex(command[10 : 10 + 2 * length]))
                )
                answer = b"Z\r"
            case "V":
                answer = b"V1013\r"
        os.write(self._master, answer)
