"""Vibration as feedback: tactors on a serial line or UDP, and the rumble of a controller."""

from collections.abc import Sequence

from labcrane import Feedback, Machine, Offer, hookimpl, offer
from labcrane.core import Finding
from labcrane.registry import LAB, Prompt
from labcrane_vibration.settings import VibrationSettings

labcrane_api = 1


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    def build(settings: VibrationSettings, machine: Machine) -> Feedback:
        from labcrane_vibration.vibration import Vibration

        del machine  # the same for every machine
        return Vibration(settings)

    def examine(settings: VibrationSettings, ask: Prompt | None) -> Sequence[Finding]:
        from labcrane_vibration.device import examine

        del ask  # nothing needs to be moved
        return examine(settings)

    needs = {"pygame": LAB, "serial": LAB}
    return [offer("vibration", VibrationSettings, build, examine, needs=needs)]
