"""Pictures of cameras as a stream of strings for pages; it is not recorded.

A sample of ``labcrane.pictures.<name>`` is a JSON object: ``camera``, its name; ``due``, when what
it shows happened; ``legend``, what its greys mean; ``png``, the picture in base 64. Its time is
that of the newest frame when the picture was made. Nothing is made while nobody watches.
"""

import base64
import json
import queue
import threading
from collections.abc import Mapping
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from labcrane.core.records import CameraImage
from labcrane.streams.outlets import channel, source_id, stream_info

if TYPE_CHECKING:
    pass

KIND = "CameraImage"
KEPT_S = 1
"""Of a stream without a rate liblsl keeps a hundred samples for each second: some megabytes."""

QUICKLY = 1
"""zlib's level: twice the bytes of the best one in a tenth of the time."""


def pictures_source(source: str, name: str) -> str:
    """Return the source id of the pictures of feedback ``name``."""
    return source_id(source, f"labcrane.pictures.{name}")


class PictureOutlet:
    """Sends pictures from a thread of its own: views do not wait for it."""

    def __init__(self, name: str, source: str) -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        info = stream_info(
            f"labcrane.pictures.{name}", KIND, 1, "string", rate_hz=0.0, source=source
        )
        channel(info, label="picture", unit="none", type="JSON")
        self._outlet: pylsl.StreamOutlet = pylsl.StreamOutlet(info, max_buffered=KEPT_S)
        self._waiting: queue.SimpleQueue[tuple[Mapping[str, CameraImage], float] | None]
        self._waiting = queue.SimpleQueue()
        self._free = threading.Event()
        self._free.set()
        self._thread = threading.Thread(target=self._send, name="pictures", daemon=True)
        self._thread.start()

    @property
    def wanted(self) -> bool:
        """Whether the stream has a receiver, and earlier pictures have been sent."""
        return self._free.is_set() and bool(self._outlet.have_consumers())

    def push(self, pictures: Mapping[str, CameraImage], stamp: float) -> None:
        """Send pictures of cameras by name; ``stamp`` is when the newest frame was due."""
        if pictures:
            self._free.clear()
            self._waiting.put((pictures, stamp))

    def close(self) -> None:
        """End the stream."""
        self._waiting.put(None)
        self._thread.join()

    def _send(self) -> None:
        while (job := self._waiting.get()) is not None:
            pictures, stamp = job
            for camera, picture in pictures.items():
                self._outlet.push_sample([_written(camera, picture)], stamp)
            self._free.set()


def _written(camera: str, picture: CameraImage) -> str:
    coded = base64.b64encode(png(picture.pixels)).decode()
    return json.dumps(
        {"camera": camera, "due": picture.due, "legend": picture.legend, "png": coded}
    )


def png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Return a picture as a PNG file, without loss.

    Parameters
    ----------
    pixels
        From the top; greys of shape ``(height, width)``, or red, green and blue of shape
        ``(height, width, 3)``.
    """
    from PIL import Image  # noqa: PLC0415 - loads when pictures are wanted

    written = BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(written, "PNG", compress_level=QUICKLY)
    return written.getvalue()
