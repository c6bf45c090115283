"""my_part: a line that signals events to other devices."""

from collections.abc import Sequence
from pathlib import Path
from typing import IO

from labcrane import DeviceError, Offer, Run, Settings, Trigger, hookimpl, offer
from labcrane.core import Echo

labcrane_api = 1


class MyPartSettings(Settings):
    """Settings of my_part; a protocol writes them next to ``use``."""

    device: Path = Path("/dev/null")
    """What codes are written to."""


class MyPart(Trigger):
    """Writes every code as one byte. A file replaces the device until you open a real one."""

    def __init__(self, settings: MyPartSettings) -> None:
        self.codes = {"trial.start": 1, "trial.end": 2}
        self._path = settings.device
        self._file: IO[bytes] | None = None

    def open(self, run: Run) -> None:
        try:
            self._file = self._path.open("wb", buffering=0)
        except OSError as error:
            raise DeviceError(f"{self._path} cannot be opened: {error}; plug it in") from error

    def send(self, codes: Sequence[int], now: float) -> Sequence[Echo]:
        # Never wait here, and raise nothing: self.fault says what is wrong, None when all is well.
        if self._file is not None and codes:
            try:
                self._file.write(bytes(codes))
                self.fault = None
            except OSError as error:
                self.fault = f"{self._path}: {error}"
        return ()

    def close(self) -> None:
        if self._file is not None:
            self._file.close()


@hookimpl
def labcrane_triggers() -> list[Offer[Trigger]]:
    return [offer("my_part", MyPartSettings, MyPart)]
