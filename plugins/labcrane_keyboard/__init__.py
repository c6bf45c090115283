"""The keyboard as an input, through the window of a view."""

from labcrane import InputDevice, Machine, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_keyboard.settings import KeyboardSettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    def keyboard(settings: KeyboardSettings, machine: Machine) -> InputDevice:
        from labcrane_keyboard.keyboard import Keyboard

        del machine  # axes are named by the protocol
        return Keyboard(settings)

    return [offer("keyboard", KeyboardSettings, keyboard, needs={"pylsl": LAB})]
