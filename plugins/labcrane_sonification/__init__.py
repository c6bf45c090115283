"""The study's auditory feedback: a tone that tells the distance of tip and target."""

from labcrane import Feedback, Machine, Offer, hookimpl, offer
from labcrane_sonification.settings import SonificationSettings


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    def build(settings: SonificationSettings, machine: Machine) -> Feedback:
        from labcrane_sonification.sonification import Sonification

        del machine  # the same for every machine
        return Sonification(settings)

    return [offer("sonification", SonificationSettings, build)]
