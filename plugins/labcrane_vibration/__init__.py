"""Vibration as feedback: tactors on a serial line or UDP, and the rumble of a controller."""

from labcrane import Feedback, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_vibration.settings import VibrationSettings

labcrane_api = 1


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    build, examine = "labcrane_vibration.vibration:Vibration", "labcrane_vibration.device:examine"
    needs = {"pygame": LAB, "serial": LAB}
    return [offer("vibration", VibrationSettings, build, examine, needs=needs)]
