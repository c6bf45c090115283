"""Footage of a session: which frame of a camera, screen or microphone is shown at a time."""

import io
import wave
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import Any, Protocol

import numpy as np

from labcrane.errors import RecordingError
from labcrane.recording.films.film_file import FilmFile
from labcrane.recording.pictures import CAPTURED
from labcrane.types import FloatArray

STEP_S = 1e-3
"""The level of sound is the peak of so much of it."""

LASTS = 1.5
"""Before a gap, a frame is shown for so many usual durations."""

FULL_SCALE = 32_768.0

JOURNALS = frozenset({".xdf", ".jsonl"})
"""Of the session itself: a recording may be called ``run``, as its journal is."""


class FrameList(Protocol):
    """The list of frames, as :class:`labcrane.recording.participant_file.reader.Stream` has it."""

    @property
    def name(self) -> str: ...

    @property
    def time(self) -> FloatArray: ...

    @property
    def time_error(self) -> FloatArray: ...

    def columns(self, names: Sequence[str], /) -> Mapping[str, Any]: ...

    def __len__(self) -> int: ...


class Footage:
    """The frames of one recording of a session.

    Parameters
    ----------
    stream
        The list of its frames.
    folder, session
        Where its files are, and whose they are.
    """

    def __init__(self, stream: FrameList, folder: Path, session: int) -> None:
        self.name = stream.name.removeprefix(CAPTURED)
        rows = stream.columns(("frame.number", "file", "pts"))
        order = np.argsort(stream.time, kind="stable")
        self.time: FloatArray = stream.time[order]
        self._number, self._file = (rows[name][order] for name in ("frame.number", "file"))
        self._pts = rows["pts"][order]
        self.time_error: FloatArray = stream.time_error[order]
        self._folder, self._session = folder, session
        self._follows = (np.diff(self._file) == 0) & (np.diff(self._number) == 1)
        steps = np.diff(self.time)[np.diff(self._file) == 0]
        self.period_s = float(np.median(steps)) if len(steps) else 0.0
        self._reading = Lock()  # each question of a page has a thread of its own
        self._reader: FilmFile | None = None
        self._open = 0

    def listed(self) -> Iterator[dict[str, Any]]:
        """Yield what is known of each file: name, first and last time, frames, rate, and so on."""
        for number, path in self.files.items():
            rows = np.flatnonzero(self._file == number)
            first, last = self.time[rows[[0, -1]]].tolist()
            numbers = self._number[rows[[0, -1]]]
            yield {
                "recording": self.name,
                "file": "" if path is None else path.name,
                "time": first,
                "until": last,
                "rate_hz": 1.0 / self.period_s if self.period_s else np.nan,
                "frames": len(rows),
                "dropped": int(numbers[1] - numbers[0]) + 1 - len(rows),
                "time_error": float(np.quantile(self.time_error[rows], 0.95)),
            }

    @property
    def files(self) -> dict[int, Path | None]:
        """The files by their numbers; None for one that is missing."""
        found: dict[int, Path | None] = {}
        for number in np.unique(self._file).astype(int).tolist():
            stem = f"ses-{self._session:02d}_{self.name}" + (f".{number}" if number > 1 else "")
            there = (path for path in self._folder.glob(f"{stem}.*") if path.stem == stem)
            found[number] = next((path for path in there if path.suffix not in JOURNALS), None)
        return found

    def row(self, now: float) -> int:
        """Return which frame is shown at a time, in seconds on the session's clock.

        A frame is shown until the next one. Where none follows at once, it is shown for a usual
        duration, and then there is a gap.

        Raises
        ------
        RecordingError
            There is a gap; the message says which.
        """
        row = int(np.searchsorted(self.time, now + 1e-9, side="right")) - 1
        if row < 0:
            raise RecordingError("no frame: the recording begins later")
        last = row == len(self.time) - 1
        if (not last and self._follows[row]) or now - self.time[row] <= LASTS * self.period_s:
            return row
        if last:
            raise RecordingError("no frame: the recording has ended")
        if self._file[row] != self._file[row + 1]:
            raise RecordingError(
                f"no frame: a gap of {self.time[row + 1] - self.time[row]:.1f} s between files "
                f"{self._file[row]:.0f} and {self._file[row + 1]:.0f}"
            )
        missing = self._number[row + 1] - self._number[row] - 1
        raise RecordingError(f"no frame: {missing:.0f} were dropped here")

    def picture(self, row: int) -> bytes:
        """Return a frame as a JPEG.

        Raises
        ------
        RecordingError
            Its file is missing or damaged, or PyAV is not installed.
        """
        with self._reading:
            return self._at(int(self._file[row])).jpeg(float(self._pts[row]))

    @property
    def is_sound(self) -> bool:
        """Whether it is sound; raises as :meth:`picture` does."""
        with self._reading:
            return self._at(int(self._file[0])).is_sound

    def sound(self, begin: float, seconds: float) -> bytes:
        """Return the sound from a time on as a WAV file of one channel; gaps are silent."""
        with self._reading:
            first, end = np.searchsorted(
                self.time, (begin - LASTS * self.period_s, begin + seconds)
            )
            rate_hz, out, place = 0, np.zeros(0, np.int16), 0
            for row, samples, rate_hz in self._samples(int(first), int(end)):
                if not len(out):
                    out = np.zeros(round(seconds * rate_hz), np.int16)
                if row == first or not self._follows[row - 1]:
                    place = round((self.time[row] - begin) * rate_hz)
                piece = samples[max(-place, 0) : max(len(out) - place, 0)]
                out[max(place, 0) : max(place, 0) + len(piece)] = piece
                place += len(samples)
        file = io.BytesIO()
        with wave.open(file, "wb") as written:
            written.setnchannels(1)
            written.setsampwidth(2)
            written.setframerate(rate_hz or round(1 / STEP_S))
            written.writeframes(out.tobytes())
        return file.getvalue()

    def level(self, part: tuple[int, int, int, int] | None = None) -> tuple[FloatArray, FloatArray]:
        """Return times on the session's clock, and how bright or loud it is then, from 0 to 1.

        A picture has the mean of its part (left, top, width, height), sound the peak of each
        millisecond.
        """
        found: list[tuple[FloatArray, FloatArray]] = []
        with self._reading:
            if self._at(int(self._file[0])).is_sound:
                for row, samples, rate_hz in self._samples(0, len(self.time)):
                    starts = np.arange(0, len(samples), max(round(STEP_S * rate_hz), 1))
                    peaks = np.maximum.reduceat(np.abs(samples.astype(float)), starts)
                    found.append((self.time[row] + starts / rate_hz, peaks / FULL_SCALE))
            else:
                left, top, width, height = part or (0, 0, None, None)
                cut = (slice(top, height and top + height), slice(left, width and left + width))
                for row, frame in self._frames(0, len(self.time)):
                    grey = frame.to_ndarray(format="gray")[cut]
                    if not grey.size:
                        raise RecordingError(
                            f"{self.name}: part {list(part or ())} is outside the picture, which "
                            f"is {frame.width} x {frame.height}; correct it in the protocol"
                        )
                    found.append((self.time[row : row + 1], np.array([grey.mean() / 255.0])))
        times, levels = zip(*found, strict=True) if found else ((), ())
        return np.concatenate([np.empty(0), *times]), np.concatenate([np.empty(0), *levels])

    def _frames(self, first: int, end: int) -> Iterator[tuple[int, Any]]:
        for row in range(first, end):
            yield row, self._at(int(self._file[row])).frame(float(self._pts[row]))

    def _samples(self, first: int, end: int) -> Iterator[tuple[int, Any, int]]:
        """Yield row, samples of one channel, and how many there are in a second."""
        from av import AudioResampler  # noqa: PLC0415 - an extra

        mono = AudioResampler(format="s16", layout="mono")
        for row, frame in self._frames(first, end):
            frame.pts = None  # nothing is filled in between two files
            samples = [each.to_ndarray()[0] for each in mono.resample(frame)]
            yield row, np.concatenate([np.empty(0, np.int16), *samples]), frame.sample_rate

    def _at(self, number: int) -> FilmFile:
        if self._reader is None or self._open != number:
            path = self.files[number]
            if path is None:
                raise RecordingError(
                    f"{self.name}: file {number} is missing in {self._folder}; put it back there"
                )
            self._reader, self._open = FilmFile(path), number
        return self._reader


def footage(streams: Mapping[str, FrameList], folder: Path, session: int) -> dict[str, Footage]:
    """Return the footage of a session by the names of its recordings."""
    found = (
        Footage(stream, folder, session)
        for name, stream in streams.items()
        if name.startswith(CAPTURED) and len(stream)
    )
    return {each.name: each for each in found}
