"""Glances: where the operator looked, and at which area of the picture, at any time of a film.

A gaze stream (type ``Gaze``) says it by a channel ``aoi``, or by a place in the window; a view's
stream of areas (``labcrane.feedback.NAME.areas``) says where things were in its picture. A picture
is the one handed to the screen last: the display's own delay, which only ``labcrane doctor
--display`` measures, is not in it, and the page says so.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from labcrane.analysis.gaze import (
    area_columns,
    area_name,
    looks_on_screen,
)
from labcrane.analysis.gaze_streams import (
    CHANNEL,
    gaze_stream,
    in_window,
    window_gaze,
    window_pictures,
)
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.types import FloatArray

TRAIL_S = 0.5
"""How much of the way of the gaze is shown."""

STALE_S = 0.5
"""Older gaze is not the present one: a blink, or a gap."""

LANE = 300
"""Steps of the lane beneath the time line."""


@dataclass(frozen=True, slots=True)
class Glance:
    """What is seen at one time, in pixels of the window; NaN where it is not known.

    Attributes
    ----------
    areas
        Left, top, right and bottom of each area in the picture, by name.
    trail
        Where it was looked at, oldest first, shape ``(n, 2)``.
    looked
        The area that is looked at; empty for none.
    """

    areas: dict[str, tuple[float, float, float, float]]
    trail: FloatArray
    looked: str


class Glances:
    """The gaze of a session, and the areas of its picture.

    Parameters
    ----------
    start
        Time of the film's first frame, in seconds on the session's clock.
    """

    def __init__(self, record: SessionRecord, start: float) -> None:
        self._start = start
        self._gaze = gaze_stream(record)
        self._pictures = window_pictures(record)
        self._place = None
        if self._gaze is not None and in_window(self._gaze):
            self._place = window_gaze(record, self._gaze)
        self._named = self._gaze is not None and CHANNEL in self._gaze.units
        self._areas = {} if self._pictures is None else area_columns(self._pictures)

    @property
    def known(self) -> bool:
        """Whether there is anything to be shown."""
        return bool(self._place is not None and self._areas) or self._named

    def at(self, at: float) -> Glance:
        """Return what is seen at a time, in seconds from the film's start."""
        now = self._start + at
        areas, trail, looked = {}, np.empty((0, 2)), ""
        if self._pictures is not None and self._areas:
            areas = self._picture(self._pictures, now)
        if self._gaze is not None:
            first, last = np.searchsorted(self._gaze.time, (now - TRAIL_S, now + 1e-9)).tolist()
            fresh = last > first and now - float(self._gaze.time[last - 1]) < STALE_S
            if fresh and self._place is not None:
                trail = self._place.spots(first, last)
            if fresh and self._named:
                looked = area_name(self._gaze.column(CHANNEL, last - 1, last)[0])
            elif len(trail) and areas:
                looked = self._on(trail[-1:], areas)
        return Glance(areas, trail, looked)

    def lane(self, begin: float, end: float) -> list[str]:
        """Return what is looked at in each of :data:`LANE` steps between two times."""
        middles = begin + (end - begin) * (np.arange(LANE) + 0.5) / LANE
        return [self.at(float(middle)).looked for middle in middles]

    def _picture(
        self, pictures: Stream, now: float
    ) -> dict[str, tuple[float, float, float, float]]:
        row = int(np.searchsorted(pictures.time, now + 1e-9)) - 1
        if row < 0:
            return {}
        found = pictures.columns([c for each in self._areas.values() for c in each], row, row + 1)
        boxes = {
            name: (*(float(found[column][0]) for column in columns),)
            for name, columns in self._areas.items()
        }
        return {
            name: (box[0], box[1], box[2], box[3])
            for name, box in boxes.items()
            if all(map(math.isfinite, box))
        }

    def _on(self, gaze: FloatArray, areas: dict[str, tuple[float, float, float, float]]) -> str:
        boxes = {name: np.array([box]) for name, box in areas.items()}
        return looks_on_screen(np.zeros(1), gaze, np.zeros(1), boxes, 0.0).area[0]

    def as_json(self, at: float) -> dict[str, Any]:
        """Return :meth:`at` ready for JSON: places that are not known are left out."""
        glance = self.at(at)
        trail = [[round(x, 1), round(y, 1)] for x, y in glance.trail.tolist() if x == x and y == y]  # noqa: PLR0124 - NaN
        return {
            "areas": [{"name": name, "box": list(box)} for name, box in glance.areas.items()],
            "trail": trail,
            "looked": glance.looked,
        }
