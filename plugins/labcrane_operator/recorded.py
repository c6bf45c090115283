"""The axes of a recorded session, played again."""

from collections.abc import Mapping

import numpy as np

from labcrane import (
    FloatArray,
    Frame,
    InputDevice,
    ProtocolError,
    RecordingError,
    Run,
    Tick,
    open_recording,
)
from labcrane.core import Value, signals_of
from labcrane_operator.settings import RecordedSettings


class RecordedInput(InputDevice):
    """Gives in each tick the axes that were recorded in the tick of the same number.

    A session of the same protocol, machine and versions then goes the same way, bit for bit. When
    the recording has ended the device is lost, and the session pauses or ends as its protocol says.
    """

    def __init__(self, settings: RecordedSettings) -> None:
        self._settings = settings
        try:
            recording = open_recording(settings.file)
        except RecordingError as error:
            raise ProtocolError(str(error), at=("file",)) from error
        try:
            record = recording.session(settings.session)
        except RecordingError as error:
            raise ProtocolError(str(error), at=("session",)) from error
        recorded = record.streams["input"]
        # The hands of an assistant are not the operator's.
        others = ("assist.", "estimate.")
        names = [name for name in map(str, recorded.data) if not name.startswith(others)]
        self.signals = signals_of(names, recorded.units)
        self._axes: FloatArray = recorded.data[names].to_numpy(np.float64)
        self._rate_hz = float(record.attrs["rate_hz"])
        self._at_rest = np.zeros(self._axes.shape[1])

    def open(self, run: Run) -> None:
        if run.rate_hz != self._rate_hz:
            raise ProtocolError(
                f"{self._settings.file} was recorded at {self._rate_hz:g} Hz and cannot be played "
                f"at {run.rate_hz:g} Hz; set rate_hz: {self._rate_hz:g}"
            )

    def read(self, tick: Tick, seen: Frame) -> FloatArray:
        if tick.number < len(self._axes):
            row: FloatArray = self._axes[tick.number]
            return row
        self.fault = f"the recording {self._settings.file} has ended"
        return self._at_rest

    def metadata(self) -> Mapping[str, Value]:
        return {"file": str(self._settings.file), "session": self._settings.session}
