"""my_part: a source that is recorded into files next to the participant file."""

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from labcrane import Capture, DeviceError, Offer, hookimpl, offer
from labcrane.core import Captured, CaptureSettings

labcrane_api = 1


class MyPartSettings(CaptureSettings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    period_s: float = 0.05
    """Time from one frame to the next, in seconds."""


class MyPart(Capture):
    """Writes a line for each frame. A timer replaces the device until you open a real one."""

    suffix = ".txt"

    def __init__(self, settings: MyPartSettings) -> None:
        self._settings = settings
        self._path: Path | None = None
        self._file: IO[bytes] | None = None
        self._number = 0
        self._began = 0.0

    def begin(self) -> None:
        pass  # open the device; raise DeviceError if it is not there

    def write_to(self, path: Path) -> None:
        self._path = path

    def read(self) -> Sequence[Captured]:
        time.sleep(self._settings.period_s)
        now = time.perf_counter()
        if self._path is None:
            return ()
        try:
            if self._file is None:
                number = os.open(self._path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
                self._file, self._began = os.fdopen(number, "wb", buffering=0), now
            self._file.write(b"a frame\n")
        except OSError as error:
            raise DeviceError(f"{self._path} cannot be written: {error}; make room") from error
        # State what is known: here the arrival, which is late by up to a period.
        frame = Captured(
            number=self._number,
            pts=now - self._began,
            time=now,
            clock=0.0,
            arrival=self._settings.period_s,
            lag=float("nan"),
        )
        self._number += 1
        return [frame]

    def end(self) -> Sequence[Captured]:
        if self._file is not None:
            self._file.close()
        return ()


@hookimpl
def labcrane_captures() -> list[Offer[Capture]]:
    return [offer("my_part", MyPartSettings, MyPart)]
