"""The study's auditory feedback: a tone that tells the distance of tip and target."""

from labcrane import Feedback, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_sonification.settings import SonificationSettings

labcrane_api = 1

TONE = "labcrane_sonification.sonification:Sonification"
EXAMINE = "labcrane_sonification.examination:examine"


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    return [offer("sonification", SonificationSettings, TONE, EXAMINE, needs={"pyo": LAB})]
