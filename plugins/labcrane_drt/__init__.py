"""Detection response task (ISO 17488) beside any task, and the light that presents it."""

from labcrane import Cue, Offer, SecondaryTask, hookimpl, offer
from labcrane_drt.settings import DrtSettings, LightSettings

labcrane_api = 1


@hookimpl
def labcrane_secondary() -> list[Offer[SecondaryTask]]:
    return [offer("drt", DrtSettings, "labcrane_drt.drt:Drt")]


@hookimpl
def labcrane_cues() -> list[Offer[Cue]]:
    return [offer("stimulus_light", LightSettings, "labcrane_drt.light:Light")]
