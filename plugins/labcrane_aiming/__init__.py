"""The aiming task of the crane study: alternate movements between two circles."""

from labcrane import Machine, Offer, Task, hookimpl, offer
from labcrane_aiming.settings import AimingSettings

labcrane_api = 1


@hookimpl
def labcrane_tasks() -> list[Offer[Task]]:
    def build(settings: AimingSettings, machine: Machine) -> Task:
        from labcrane_aiming.aiming import Aiming

        return Aiming(settings, machine)

    return [offer("aiming", AimingSettings, build)]
