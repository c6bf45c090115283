"""The study's visual feedback: a sphere that tells the distance of tip and target."""

from labcrane import Cue, Offer, hookimpl, offer
from labcrane_sphere.settings import SphereSettings

labcrane_api = 1


@hookimpl
def labcrane_cues() -> list[Offer[Cue]]:
    return [offer("sphere", SphereSettings, "labcrane_sphere.sphere:SphereCue")]
