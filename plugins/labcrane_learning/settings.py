"""Settings of exports for learning machines."""

from typing import Annotated, Any

from pydantic import PositiveInt

from labcrane import Settings
from labcrane.core import Unit


class EpisodeSettings(Settings):
    """Settings of :class:`~labcrane_learning.lerobot.LeRobot` and of robomimic's."""

    task: str = ""
    """The operator's task, in a sentence; the study's title by default. The words of the trial's
    condition follow it."""

    every: PositiveInt = 1
    """Every how many ticks there is a row; 8 makes 30 rows a second of 240."""

    cameras: tuple[str | dict[str, Any], ...] = ()
    """Cameras whose pictures are taken now, of the recorded frames: names of those of the view, or
    ones that are written out, ``{name: hook, eye: [...], look: [...], on: wrist}``."""

    size: Annotated[tuple[PositiveInt, PositiveInt], Unit("px")] = (320, 240)
    """Width and height of a picture, in pixels."""
