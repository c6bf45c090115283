"""Pictures of a view's cameras for the experimenter's page."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from labcrane.core import CameraImage
from labcrane_view.camera import ROUNDING_S, Camera
from labcrane_view.settings import ViewSettings

AXES = {"horizontal": 1, "vertical": 0}


class Shots:
    """Says when the next pictures are due, and cuts them out of the window's.

    Attributes
    ----------
    names
        Of the cameras whose pictures are sent.
    """

    def __init__(self, settings: ViewSettings) -> None:
        wanted = settings.supervisor
        every = [camera.name for camera in (settings.camera, *settings.beside)]
        self.names = tuple(wanted.cameras or every) if wanted else ()
        self._settings = settings
        self._due = -math.inf

    def are_due(self, now: float) -> bool:
        """Whether the frame due at ``now``, in seconds, is one to be sent."""
        wanted = self._settings.supervisor
        if wanted is None or now < self._due - ROUNDING_S:
            return False
        self._due = (math.floor(now * wanted.rate_hz + ROUNDING_S) + 1) / wanted.rate_hz
        return True

    def cut(
        self, window: npt.NDArray[np.uint8], cameras: Sequence[Camera]
    ) -> dict[str, CameraImage]:
        """Return each camera's part of the window's picture, shape ``(height, width, 3)``."""
        axis = AXES.get(self._settings.flip)
        upright = window if axis is None else np.flip(window, axis=axis)
        return {
            camera.settings.name: self._of(upright, camera)
            for camera in cameras
            if camera.settings.name in self.names
        }

    def _of(self, window: npt.NDArray[np.uint8], camera: Camera) -> CameraImage:
        wanted, part = self._settings.supervisor, camera.part
        if wanted is None:
            raise AssertionError("pictures are cut where they are wanted")
        step = math.ceil(part.width / wanted.width)  # a mean of depths would be no depth
        pixels = window[::step, part.left : part.left + part.width : step]
        if camera.settings.shows == "depth":
            near, far = camera.settings.depth_m
            return CameraImage(pixels[..., 0], camera.seen, f"white {near:g} m, black {far:g} m")
        return CameraImage(pixels, camera.seen)
