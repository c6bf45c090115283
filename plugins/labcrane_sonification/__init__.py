"""The study's auditory feedback: a tone that tells the distance of tip and target."""

from collections.abc import Sequence

from labcrane import Feedback, Machine, Offer, hookimpl, offer
from labcrane.core import Finding
from labcrane.registry import LAB, Prompt
from labcrane_sonification.settings import SonificationSettings

labcrane_api = 1


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    def build(settings: SonificationSettings, machine: Machine) -> Feedback:
        from labcrane_sonification.sonification import Sonification

        del machine  # the same for every machine
        return Sonification(settings)

    def examine(settings: SonificationSettings, ask: Prompt | None) -> Sequence[Finding]:
        from labcrane_sonification import examination

        return examination.examine(settings, ask)

    return [offer("sonification", SonificationSettings, build, examine, needs={"pyo": LAB})]
