"""A lamp for tests: the other end of a pseudo-terminal."""

import os
import threading
import tty


class LampDevice:
    """Answer as the lamp does, and keep the values that it received.

    Attributes
    ----------
    port
        Path to open as a serial port.
    """

    def __init__(self, name: str = "lamp 1.2") -> None:
        self._name = name
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.port = os.ttyname(self._theirs)
        self.light: list[int] = []
        self.motor: list[int] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with os.fdopen(self._ours, "rb", buffering=0) as line:
            rest = b""
            while chunk := line.read(4096):
                *lines, rest = (rest + chunk).split(b"\n")
                for said in lines:
                    if said == b"?":
                        os.write(self._ours, self._name.encode() + b"\n")
                    else:
                        kept = self.light if said.startswith(b"L") else self.motor
                        kept.append(int(said[2:]))
