"""BrainVision files: a header, markers, and samples that are written in chunks.

*BrainVision Core Data Format 1.0* (Brain Products, 2019). Numbers are float32, little-endian, one
sample of all channels after another; microvolts are written unchanged.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from labcrane import FloatArray, RecordingError

LARGEST = float(np.finfo(np.float32).max)


def write_brainvision(
    path: Path,
    pieces: Iterable[FloatArray],
    rate_hz: float,
    channels: Sequence[tuple[str, str]],
    markers: Sequence[tuple[int, int, str]],
) -> None:
    """Write a recording as three files.

    Parameters
    ----------
    path
        Path of the files, without an extension.
    pieces
        Samples in chunks, each of shape ``(n, n_channels)``.
    channels
        Name and unit of each.
    markers
        Sample, counted from 0, number of samples, and text of each; one that begins with ``BAD`` is
        a bad interval.

    Raises
    ------
    RecordingError
        A number is larger than a float32.
    """
    with path.with_name(f"{path.name}.eeg").open("wb") as file:
        for piece in pieces:
            if (np.abs(piece[np.isfinite(piece)]) > LARGEST).any():
                raise RecordingError(
                    f"{path.name} has a number beyond {LARGEST:.1e}, which BrainVision files do "
                    "not hold: look at the stream's channels in labcrane view, and at their units"
                )
            file.write(np.ascontiguousarray(piece, "<f4").tobytes())
    _write(path, "vmrk", _markers(path.name, markers))
    _write(path, "vhdr", _header(path.name, rate_hz, channels))


def _header(name: str, rate_hz: float, channels: Sequence[tuple[str, str]]) -> list[str]:
    return [
        "Brain Vision Data Exchange Header File Version 1.0",
        "; Written by labcrane",
        "",
        "[Common Infos]",
        "Codepage=UTF-8",
        f"DataFile={name}.eeg",
        f"MarkerFile={name}.vmrk",
        "DataFormat=BINARY",
        "DataOrientation=MULTIPLEXED",
        f"NumberOfChannels={len(channels)}",
        "; Sampling interval in microseconds",
        f"SamplingInterval={1e6 / rate_hz}",
        "",
        "[Binary Infos]",
        "BinaryFormat=IEEE_FLOAT_32",
        "",
        "[Channel Infos]",
        "; Channel number=name, reference, resolution, unit",
        *(
            f"Ch{number}={_text(label)},,1,{_text(unit)}"
            for number, (label, unit) in enumerate(channels, 1)
        ),
        "",
        "[Comment]",
    ]


def _markers(name: str, markers: Sequence[tuple[int, int, str]]) -> list[str]:
    return [
        "Brain Vision Data Exchange Marker File, Version 1.0",
        "; Written by labcrane",
        "",
        "[Common Infos]",
        "Codepage=UTF-8",
        f"DataFile={name}.eeg",
        "",
        "[Marker Infos]",
        "; Marker number=type, text, sample counted from 1, samples, channel (0: all)",
        *(
            f"Mk{number}={'Bad Interval' if text.startswith('BAD') else 'Comment'},{_text(text)},"
            f"{sample + 1},{count},0"
            for number, (sample, count, text) in enumerate(markers, 1)
        ),
    ]


def _text(text: str) -> str:
    """Return a text of one line; the format writes a comma in this way."""
    return " ".join(text.split()).replace(",", r"\1")


def _write(path: Path, ending: str, lines: list[str]) -> None:
    text = "\n".join(lines) + "\n"
    path.with_name(f"{path.name}.{ending}").write_text(text, encoding="utf-8")
