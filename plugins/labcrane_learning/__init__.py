"""Export of recordings for machines that learn from them: LeRobot and robomimic."""

from collections.abc import Sequence

from labcrane import Machine, Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_learning.settings import EpisodeSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    def lerobot(settings: EpisodeSettings, machine: Machine) -> Exporter:
        from labcrane_learning.lerobot import LeRobot

        return LeRobot(settings)

    def robomimic(settings: EpisodeSettings, machine: Machine) -> Exporter:
        from labcrane_learning.robomimic import Robomimic

        return Robomimic(settings)

    return (
        offer("lerobot", EpisodeSettings, lerobot),
        offer("robomimic", EpisodeSettings, robomimic),
    )
