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
    """Number of ticks per row; 8 gives 30 rows a second at 240 Hz."""

    cameras: tuple[str | dict[str, Any], ...] = ()
    """Cameras that the export renders from the recorded frames: names of the view's cameras, or
    settings of other cameras, ``{name: hook, eye: [...], look: [...], on: wrist}``."""

    size: Annotated[tuple[PositiveInt, PositiveInt], Unit("px")] = (320, 240)
    """Width and height of a picture, in pixels."""
