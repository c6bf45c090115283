"""Two joysticks, one for each hand."""

from labcrane import InputDevice, Machine, Offer, hookimpl, offer
from labcrane_joystick.settings import JoystickSettings


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    return [offer("dual_joystick", JoystickSettings, _dual_joystick)]


def _dual_joystick(settings: JoystickSettings, machine: Machine) -> InputDevice:
    from labcrane_joystick.dual_joystick import DualJoystick

    return DualJoystick(settings)
