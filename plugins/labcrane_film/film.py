"""Frames of a device, copied or encoded into a Matroska file, with the time of each."""

import math
import os
import re
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from statistics import median
from typing import Any

import av

from labcrane import Capture, DeviceError
from labcrane.core import Captured, Finding, Verdict
from labcrane_film.settings import ScreenSettings, SourceSettings
from labcrane_film.stamps import ArrivalSpread, StampClock

MS = Fraction(1, 1000)
"""Matroska's unit of time."""

ERRORS = (av.error.FFmpegError, OSError, ValueError)
"""What FFmpeg and the disk raise."""

RAW = frozenset({"rawvideo", "wrapped_avframe", "v210", "bitpacked"})
"""Codecs of pictures that are not compressed."""

OPEN_S, READ_S = 20.0, 3.0
CLUSTER = {"cluster_time_limit": "1000", "flush_packets": "1"}
"""What is in the file survives any kill: a second at a time goes to the disk."""

LOOKED_AT = 20
"""So many frames an examination reads."""

BACK = 3
"""Timestamps that go back so often before a file begins are of B-frames."""

DROPPED = 1.5
"""From so many periods between two stamps on, frames are missing between them."""

USUAL = 5
"""The period of pictures is the middle one of so many steps before."""


class FilmedSource(Capture):
    """A device that FFmpeg can read."""

    def __init__(self, settings: SourceSettings) -> None:
        self._settings = settings
        self._device, self._format, self._options = settings.source()
        self._input: Any = None
        self._packets: Iterator[Any] = iter(())
        self._clock, self._spread = StampClock(), ArrivalSpread()
        self._path: Path | None = None
        self._file: _File | None = None

    def begin(self) -> None:
        settings = self._settings
        if isinstance(settings, ScreenSettings) and settings.of is not None:
            self._device, self._options = settings.window(self.windows[settings.of])
        try:
            self._input = av.open(
                self._device,
                format=self._format,
                options=self._options,
                timeout=(OPEN_S, READ_S),
            )
            self._stream = getattr(self._input.streams, settings.kind)[0]
        except (*ERRORS, IndexError) as error:
            raise DeviceError(
                f"{self._called} cannot be opened: {self._hidden(error)}; plug it in, close other "
                "programs that use it, and correct its settings in the protocol"
            ) from None  # the cause has the password of an address
        self._packets = self._input.demux(self._stream)
        rate = self._stream.average_rate if settings.kind == "video" else None
        self._period = float(1 / rate) if rate else 0.0
        self._stamp, self._back = -math.inf, 0

    def write_to(self, path: Path) -> None:
        self._path = path

    def read(self) -> Sequence[Captured]:
        packet, arrival = self._next()
        timed = self._timed(packet, arrival)  # frames before the file show how late others come
        begins = packet.is_keyframe or _is_raw(self._stream)
        if self._path is None or (self._file is None and not begins):
            return ()
        try:
            if self._file is None:
                self._file = _File(self._path, self._stream, self._settings.codec)
            return self._file.write(packet, *timed)
        except ERRORS as error:
            self._drop()  # what waits for the disk is lost, and was not returned
            raise DeviceError(
                f"{self._path} cannot be written: {error}; make room on the disk of the data folder"
            ) from error

    def end(self) -> Sequence[Captured]:
        file, self._file = self._file, None
        try:
            return file.close() if file else ()
        except ERRORS as error:
            raise DeviceError(f"the end of {self._path} was not written: {error}") from error

    def close(self) -> None:
        self._drop()
        if self._input is not None:
            self._input.close()

    def _drop(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            file.drop()

    def look(self) -> Finding:
        """Return what the open device sends, from some of its frames."""
        frames = [self._timed(*self._next()) for _ in range(LOOKED_AT)]
        source = self._stream.codec_context
        text = f"{self._called} sends {source.name}"
        if self._settings.kind == "video":
            done = f"encoded by {self._settings.codec}" if _is_raw(self._stream) else "copied"
            text += f", {source.width} x {source.height}, {1 / (frames[-1][0] or math.nan):.1f} a "
            text += f"second, which is {done}"
        uncertain = max(frame.clock + frame.arrival for _, frame in frames)
        text += f"; times may be off by {1e3 * uncertain:.1f} ms, beside the device's lag"
        if self._clock.known:
            return Finding(Verdict.PASS, text)
        text += ", for its timestamps are of an unknown clock and the arrival is used"
        return Finding(Verdict.WARN, text, "use another driver or device if milliseconds matter")

    @property
    def _called(self) -> str:
        return f"{self._hidden(self._device)!r}" + (f" ({self._format})" if self._format else "")

    def _hidden(self, said: object) -> str:
        """Return a text without the user and password of the device's address."""
        login = re.search(r"://([^/]*@)", self._device)
        return str(said).replace(login[1], "") if login else str(said)

    def _next(self) -> tuple[Any, float]:
        """Return the next frame and when it came."""
        try:
            packet = next(each for each in self._packets if each.size or each.pts is None)
        except (*ERRORS, StopIteration) as error:
            raise DeviceError(
                f"{self._called} sends no more: {self._hidden(error)}; plug it in"
            ) from None
        arrival = time.perf_counter()
        if packet.pts is None:
            raise DeviceError(f"{self._called} has ended, or sends frames without a time; check it")
        return packet, arrival

    def _timed(self, packet: Any, arrival: float) -> tuple[float, Captured]:
        """Return a frame's duration and what is known of its time; its place follows."""
        settings = self._settings
        unit = float(packet.time_base)
        stamp = packet.pts * unit
        self._back += stamp <= self._stamp
        # Once may be the first report of a network camera's clock. B-frames go back often, and are
        # refused before a file begins: by doctor, and in a session once.
        if self._back and (self._file is not None or self._back >= BACK):
            raise DeviceError(
                f"timestamps of {self._called} go back: it sends B-frames, or its clock was set; "
                "switch B-frames off in the device"
            )
        self._stamp = stamp
        period = self._period or float(packet.duration or 0) * unit
        spread = self._spread.of(stamp, arrival, period)
        known = self._clock.time_of(stamp, arrival)
        moment, clock = (known[0], known[1] + unit) if known else (arrival, 0.0)
        if known and settings.grabbed:
            spread = arrival - moment
        elif known and settings.kind == "video":
            spread = 0.0
        lag = math.nan if settings.lag_s is None else settings.lag_error_s
        return period, Captured(0, stamp, moment - (settings.lag_s or 0.0), clock, spread, lag)


def examine(settings: SourceSettings) -> list[Finding]:
    """Open a device as a session would, and read some of its frames."""
    # A view's window is not open now: its screen is tried.
    shown = isinstance(settings, ScreenSettings)
    source = FilmedSource(settings.model_copy(update={"of": None}) if shown else settings)
    try:
        source.begin()
        return [source.look()]
    except DeviceError as error:
        return [Finding.failed(error)]
    finally:
        source.close()


class _File:
    """A Matroska file that is being written; it begins with the first frame."""

    def __init__(self, path: Path, stream: Any, codec: str) -> None:
        self._disk = _Disk(path)
        self._out: Any = av.open(self._disk, "w", format="matroska", options=CLUSTER)
        self._first: int | None = None
        self._last: tuple[int, float] | None = None
        self._steps: deque[float] = deque(maxlen=USUAL)
        self._waiting: deque[Captured] = deque()
        self._muxed = self._given = 0
        self._stream: Any
        self._encoder: Any = None
        if _is_raw(stream):
            self._encoder = self._stream = self._out.add_stream(codec, rate=stream.average_rate)
            source = stream.codec_context
            self._stream.width, self._stream.height = source.width, source.height
            even = not (source.width % 2 or source.height % 2)
            self._stream.pix_fmt = "yuv420p" if even else "yuv444p"
            self._stream.codec_context.time_base = MS
            self._stream.codec_context.gop_size = round(stream.average_rate or 30)
            if codec == "libx264":
                self._stream.options = {"preset": "ultrafast", "tune": "zerolatency"}
        else:
            self._stream = self._out.add_stream_from_template(stream)

    def write(self, packet: Any, period: float, timed: Captured) -> list[Captured]:
        """Write a frame, and return those that are safely in the file."""
        if self._first is None:
            self._first = packet.pts
        at = round((packet.pts - self._first) * packet.time_base / MS)
        number = 0
        if self._last is not None:
            before, stamp = self._last
            gap = timed.pts - stamp
            # In the dark a camera sends fewer pictures than it declares, and drops none.
            usual = period
            if self._stream.type == "video":
                usual = median(self._steps) if len(self._steps) == USUAL else max(period, gap)
            number = before + (round(gap / usual) if usual and gap > DROPPED * usual else 1)
            self._steps.append(gap)
        self._last = number, timed.pts
        self._waiting.append(replace(timed, number=number, pts=float(at * MS)))
        size = self._disk.size
        for each in self._encoded(packet, at):
            self._out.mux(each)
            self._muxed += 1
        # A cluster goes to the disk when the next one begins, with the frame that was just muxed;
        # of sound the muxer holds one more back.
        held = 1 if self._stream.type == "video" else 2
        return self._returned(self._muxed - held) if self._disk.size > size else []

    def close(self) -> list[Captured]:
        """End the file, and return the frames that were not returned yet."""
        try:
            for each in self._encoder.encode() if self._encoder else ():
                self._out.mux(each)
            self._out.close()
            return self._returned(self._given + len(self._waiting))
        finally:
            self._disk.close()

    def drop(self) -> None:
        """Leave the file as it is."""
        self._disk.close()

    def _encoded(self, packet: Any, at: int) -> Sequence[Any]:
        if self._encoder is None:
            packet.pts = packet.dts = at
            packet.time_base, packet.stream = MS, self._stream
            return [packet]
        found: list[Any] = []
        for frame in packet.decode():
            frame.pts, frame.time_base = at, MS
            frame.pict_type = 0  # the encoder decides, and not the device
            found += self._encoder.encode(frame)
        return found

    def _returned(self, count: int) -> list[Captured]:
        """Return the waiting frames among the first ``count`` of the file."""
        found = [self._waiting.popleft() for _ in range(max(count - self._given, 0))]
        self._given += len(found)
        return found


class _Disk:
    """The file for FFmpeg: for the user only, and what it takes is counted."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = open(path, "xb", buffering=0, opener=_private)  # noqa: SIM115
        self.size = 0

    def write(self, data: Any) -> int:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) or 0 :]
        self.size += len(data)
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def close(self) -> None:
        self._file.close()
        if not self._path.stat().st_size:
            self._path.unlink()  # the disk was full from its first byte on


def _is_raw(stream: Any) -> bool:
    """Whether pictures come uncompressed, each complete in itself."""
    return stream.type == "video" and stream.codec_context.name in RAW


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)
