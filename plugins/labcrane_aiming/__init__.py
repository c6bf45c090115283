"""The aiming task of the crane study: alternate movements between two circles."""

from labcrane import Offer, Task, hookimpl, offer
from labcrane_aiming.settings import AimingSettings

labcrane_api = 1


@hookimpl
def labcrane_tasks() -> list[Offer[Task]]:
    return [offer("aiming", AimingSettings, "labcrane_aiming.aiming:Aiming")]
