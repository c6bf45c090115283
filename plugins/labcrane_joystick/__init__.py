"""Two joysticks, one for each hand."""

from labcrane import InputDevice, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_joystick.settings import JoystickSettings

labcrane_api = 1

STICKS = "labcrane_joystick.dual_joystick:DualJoystick"
EXAMINE = "labcrane_joystick.examination:examine"


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    return [offer("dual_joystick", JoystickSettings, STICKS, EXAMINE, needs={"pygame": LAB})]
