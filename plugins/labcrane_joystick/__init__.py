"""Two joysticks, one for each hand."""

from collections.abc import Sequence

from labcrane import InputDevice, Machine, Offer, hookimpl, offer
from labcrane.core import Finding
from labcrane.registry import LAB, Prompt
from labcrane_joystick.settings import JoystickSettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    return [
        offer("dual_joystick", JoystickSettings, _dual_joystick, _examine, needs={"pygame": LAB})
    ]


def _dual_joystick(settings: JoystickSettings, machine: Machine) -> InputDevice:
    from labcrane_joystick.dual_joystick import DualJoystick

    return DualJoystick(settings)


def _examine(settings: JoystickSettings, ask: Prompt | None) -> Sequence[Finding]:
    from labcrane_joystick import examination

    return examination.examine(settings, ask)
