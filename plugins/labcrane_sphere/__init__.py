"""The study's visual feedback: a sphere that tells the distance of tip and target."""

from labcrane import Cue, Machine, Offer, hookimpl, offer
from labcrane_sphere.settings import SphereSettings

labcrane_api = 1


@hookimpl
def labcrane_cues() -> list[Offer[Cue]]:
    def build(settings: SphereSettings, machine: Machine) -> Cue:
        from labcrane_sphere.sphere import SphereCue

        del machine  # the same for every machine
        return SphereCue(settings)

    return [offer("sphere", SphereSettings, build)]
