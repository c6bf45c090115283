"""Pictures of cameras, from the LSL streams of the views."""

import json
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from labcrane.streams.newest import NewestSample
from labcrane.streams.pictures import KEPT_S, pictures_source

PAUSE_S = 0.05
STALE_S = 3.0
"""A picture older than this is not shown: it could be mistaken for the present one."""


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture as the page shows it.

    Attributes
    ----------
    source
        What a browser takes as the address of an image.
    legend
        What its greys mean; empty for colours.
    due, made
        When what it shows happened, and when the picture was made, in seconds.
    """

    source: str
    legend: str
    due: float
    made: float


class Pictures:
    """Keeps the newest picture of every camera. A thread for each view pulls; pages read.

    Parameters
    ----------
    cameras
        Names of the cameras of each view.
    """

    def __init__(self, source: str, cameras: Mapping[str, tuple[str, ...]]) -> None:
        self.cameras = cameras
        self._newest: dict[tuple[str, str], Shot] = {}
        self._unread: dict[str, str] = {}
        self._stop = threading.Event()
        self._threads = [
            threading.Thread(
                target=self._pull,
                args=(view, pictures_source(source, view)),
                name=f"pictures of {view}",
                daemon=True,
            )
            for view in cameras
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Let go of all streams."""
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def of(self, view: str, camera: str) -> tuple[Shot | None, str]:
        """Return the picture that may be shown now, if there is one, and its caption."""
        import pylsl  # noqa: PLC0415

        shot = self._newest.get((view, camera))
        if shot is None:
            return None, self._unread.get(view, "no picture yet")
        now = pylsl.local_clock()
        if now - shot.made > STALE_S:
            why = self._unread.get(view, "")
            return None, " · ".join(filter(None, [f"no picture for {now - shot.made:.0f} s", why]))
        return shot, " · ".join(filter(None, [f"{now - shot.due:.1f} s old", shot.legend]))

    def _pull(self, view: str, wanted: str) -> None:
        pictures = NewestSample({"source_id": wanted}, buffer_s=KEPT_S)
        while not self._stop.wait(PAUSE_S):
            for (text,), stamp in zip(*pictures.pull(), strict=True):
                self.hear(view, text, stamp)
        pictures.close()

    def hear(self, view: str, text: str, stamp: float) -> None:
        """Take up a picture of a view; one that cannot be read is said in its place."""
        try:
            sample = json.loads(text)
            source = f"data:image/png;base64,{sample['png']}"
            shot = Shot(source, str(sample["legend"]), float(sample["due"]), stamp)
            self._newest[view, str(sample["camera"])] = shot
        except (ValueError, TypeError, LookupError) as error:
            self._unread[view] = f"a picture cannot be read: {error!r}"
        else:
            self._unread.pop(view, None)
