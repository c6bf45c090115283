"""Detection response task (ISO 17488) beside any task, and the light that presents it."""

from labcrane import Cue, Machine, Offer, SecondaryTask, hookimpl, offer
from labcrane_drt.settings import DrtSettings, LightSettings

labcrane_api = 1


@hookimpl
def labcrane_secondary() -> list[Offer[SecondaryTask]]:
    def build(settings: DrtSettings, machine: Machine) -> SecondaryTask:
        from labcrane_drt.drt import Drt

        del machine  # the same for every machine
        return Drt(settings)

    return [offer("drt", DrtSettings, build)]


@hookimpl
def labcrane_cues() -> list[Offer[Cue]]:
    def build(settings: LightSettings, machine: Machine) -> Cue:
        from labcrane_drt.light import Light

        del machine
        return Light(settings)

    return [offer("stimulus_light", LightSettings, build)]
