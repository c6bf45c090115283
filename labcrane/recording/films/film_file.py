"""File of a film, from which single frames are read. PyAV is imported when one is opened."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from labcrane.errors import RecordingError

SAME_S = 6e-4
"""Places in a file are counted in milliseconds."""

AHEAD_S = 2.0
"""A frame that is further ahead is sought: up to there, decoding goes on."""


class FilmFile:
    """A file that is open for reading."""

    def __init__(self, path: Path) -> None:
        try:
            import av  # noqa: PLC0415 - an extra
        except ImportError:
            raise RecordingError(
                "frames need PyAV; install it: pip install 'labcrane[video]'"
            ) from None
        self.path = path
        self._av, self._errors = av, (av.error.FFmpegError, OSError, ValueError)
        try:
            self._input: Any = av.open(str(path))
            self._stream: Any = self._input.streams[0]
        except (*self._errors, IndexError) as error:
            raise RecordingError(f"{path} cannot be read: {error}") from error
        self.is_sound = self._stream.type == "audio"
        self._copied = self._stream.codec_context.name == "mjpeg"
        self._unit = float(self._stream.time_base or 0)
        self._packets: Iterator[tuple[Any, Any]] = iter(())
        self._pts = np.inf
        self._found: tuple[Any, Any] = (None, None)

    def frame(self, pts: float) -> Any:
        """Return the decoded frame at a place."""
        packet, frame = self._to(pts)
        return packet.decode()[0] if frame is None else frame

    def jpeg(self, pts: float) -> bytes:
        """Return the frame at a place as a JPEG: as the camera made it, if it did."""
        packet, frame = self._to(pts)
        if frame is None:
            return bytes(packet)
        encoder = self._av.CodecContext.create("mjpeg", "w")
        encoder.width, encoder.height, encoder.pix_fmt = frame.width, frame.height, "yuvj420p"
        encoder.time_base = Fraction(1, 1000)
        encoder.options = {"qmin": "2", "qmax": "4"}
        frame = frame.reformat(format="yuvj420p", dst_color_range="JPEG")
        return b"".join(map(bytes, [*encoder.encode(frame), *encoder.encode()]))

    def _to(self, pts: float) -> tuple[Any, Any]:
        """Read on, or seek, to a place; return its packet, or its frame."""
        if abs(self._pts - pts) < SAME_S:
            return self._found
        try:
            if not 0.0 <= pts - self._pts < AHEAD_S:
                self._input.seek(int(pts / self._unit), stream=self._stream)
                self._packets = self._read()
            for packet, frame in self._packets:
                self._found = packet, frame
                self._pts = (packet if frame is None else frame).pts * self._unit
                if self._pts > pts - SAME_S:
                    break
        except self._errors as error:
            self._pts = np.inf
            raise RecordingError(f"{self.path} cannot be read at {pts:.3f} s: {error}") from error
        if abs(self._pts - pts) >= SAME_S:
            self._pts = np.inf
            raise RecordingError(f"{self.path} has no frame at {pts:.3f} s: it is damaged there")
        return self._found

    def _read(self) -> Iterator[tuple[Any, Any]]:
        for packet in self._input.demux(self._stream):
            if self._copied:
                if packet.size:
                    yield packet, None
            else:
                for frame in packet.decode():
                    yield None, frame
