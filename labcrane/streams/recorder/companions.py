"""A stream in the journal, with all that is known of its times.

XDF has no fields for clock probes with their own time and round trip, for arrival times, resets
and gaps. They are streams of their own beside each recorded stream, stamped with our clock; the
same offsets are written as XDF has them too, so that any reader can correct the stream.
"""

import json
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane.recording.foreign_streams import (
    ARRIVALS,
    NOTES,
    PROBES,
    companion_headers,
)
from labcrane.recording.xdf.header import StreamHeader
from labcrane.recording.xdf.writer import XdfWriter
from labcrane.streams.probes import Probe
from labcrane.types import FloatArray


class RecordedStreamWriter:
    """Writes a stream's samples and all that is known of their times. For several threads."""

    def __init__(self, writer: XdfWriter, header: StreamHeader) -> None:
        self._writer = writer
        self._dtype = header.dtype
        self._stream = writer.add_stream(header)
        beside = companion_headers(header, self._stream)
        self._probes = writer.add_stream(beside[PROBES])
        self._arrivals = writer.add_stream(beside[ARRIVALS])
        self._notes = writer.add_stream(beside[NOTES])

    def samples(self, stamps: FloatArray, data: npt.NDArray[Any]) -> None:
        """Write samples as they came, ``data`` of shape ``(n_samples, n_channels)``."""
        if self._dtype is None:
            rows = [[text.decode(errors="replace") for text in row] for row in data]
            self._writer.write_texts(self._stream, stamps.tolist(), rows)
        else:
            values = np.ascontiguousarray(data, dtype=self._dtype)
            self._writer.write_samples(self._stream, stamps, values)

    def arrival(self, count: int, time: float) -> None:
        """Note that ``count`` samples had come by ``time``."""
        self._writer.write_sample(self._arrivals, time, np.array([float(count), time]))

    def probe(self, probe: Probe) -> None:
        """Write a clock probe.

        XDF's own clock offset pairs it with the source's time at the measurement, so that readers
        that know nothing of the rest are not biased by its age.
        """
        self._writer.write_sample(self._probes, probe.local, np.array(probe))
        self._writer.write_offset(self._stream, probe.remote_time, probe.offset)

    def note(self, time: float, event: str, **data: Any) -> None:
        """Write a note."""
        text = json.dumps({"event": event, **data}, ensure_ascii=False)
        self._writer.write_texts(self._notes, [time], [[text]])
