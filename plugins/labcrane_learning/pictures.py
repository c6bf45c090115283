"""Pictures for the rows of episodes, rendered from the recorded frames."""

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from labcrane import ProtocolError
from labcrane.analysis import Participant
from labcrane.replay import Retake
from labcrane_learning.episodes import Episode, ticks_of
from labcrane_learning.settings import EpisodeSettings

Picture = npt.NDArray[np.uint8]


class EpisodePictures:
    """Pictures of one participant's episodes.

    Those of a session are taken camera by camera when its first episode asks, and wait on disk.
    """

    def __init__(self, participant: Participant, settings: EpisodeSettings) -> None:
        self._participant, self._settings = participant, settings
        self._number = 0
        self._folder: TemporaryDirectory[str] | None = None
        self._names: list[str] = []

    def __enter__(self) -> "EpisodePictures":
        return self

    def __exit__(self, *error: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def of(self, episode: Episode) -> Iterator[dict[str, bytes]]:
        """Yield the pictures of each row as PNG by their cameras; nothing without cameras."""
        if not self._settings.cameras:
            return
        folder = self._taken(episode.session)
        for tick in episode.ticks.tolist():
            yield {
                name: (folder / f"{at}-{tick}.png").read_bytes()
                for at, name in enumerate(self._names)
            }

    def _taken(self, number: int) -> Path:
        if self._folder is not None and self._number == number:
            return Path(self._folder.name)
        self.__exit__()
        self._folder, self._number = TemporaryDirectory(prefix="labcrane-pictures-"), number
        self._names = []
        folder = Path(self._folder.name)
        record = self._participant.recording.session(number)
        ticks = ticks_of(record, self._settings.every).tolist()
        for at, camera in enumerate(self._settings.cameras):
            with Retake(record, camera, self._settings.size) as retake:
                if retake.name in self._names:
                    raise ProtocolError(
                        f"two cameras are called {retake.name!r}; give each a name of its own"
                    )
                self._names.append(retake.name)
                for tick in ticks:
                    (folder / f"{at}-{tick}.png").write_bytes(_png(retake.take(tick)))
        return folder


def unpacked(png: bytes) -> Picture:
    """Return the picture of a PNG file, shape ``(height, width, 3)``."""
    from PIL import Image

    with Image.open(BytesIO(png)) as image:
        return np.asarray(image, np.uint8)


def _png(picture: Picture) -> bytes:
    from PIL import Image

    written = BytesIO()
    Image.fromarray(picture).save(written, "PNG", compress_level=1)
    return written.getvalue()


class Histogram:
    """Count how often each value occurs in pictures; all their statistics follow from that."""

    def __init__(self) -> None:
        self.counts = np.zeros((3, 256), np.int64)
        self.pictures = 0

    def add(self, picture: Picture) -> None:
        """Count a picture in."""
        for channel in range(3):
            self.counts[channel] += np.bincount(picture[..., channel].ravel(), minlength=256)
        self.pictures += 1

    def statistics(self, quantiles: dict[str, float]) -> dict[str, Any]:
        """Return LeRobot's statistics of a camera's pictures, each ``(3, 1, 1)``, 0 to 1."""
        values = np.arange(256) / 255.0
        share = self.counts / self.counts.sum(axis=1, keepdims=True)
        below = np.cumsum(share, axis=1)
        mean = share @ values
        spread = np.sqrt(np.maximum(share @ values**2 - mean**2, 0.0))
        there = self.counts > 0
        found = {
            "min": values[np.argmax(there, axis=1)],
            "max": values[255 - np.argmax(there[:, ::-1], axis=1)],
            "mean": mean,
            "std": spread,
        }
        for name, at in quantiles.items():
            found[name] = values[np.argmax(below >= at - 1e-12, axis=1)]
        shaped: dict[str, Any] = {name: _shaped(numbers) for name, numbers in found.items()}
        return shaped | {"count": [self.pictures]}


def _shaped(numbers: Sequence[float] | npt.NDArray[np.float64]) -> list[list[list[float]]]:
    return [[[float(number)]] for number in numbers]
