"""Settings of exports for learning machines."""

from labcrane import Settings


class EpisodeSettings(Settings):
    """Settings of :class:`~labcrane_learning.lerobot.LeRobot` and of robomimic's."""

    task: str = ""
    """What the operator was to do, in a sentence; the study's title by default. The words of a
    trial's condition stand behind it."""
