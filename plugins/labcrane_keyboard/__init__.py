"""The keyboard as an input, through the window of a view."""

from labcrane import InputDevice, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_keyboard.settings import KeyboardSettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    keyboard = "labcrane_keyboard.keyboard:Keyboard"
    return [offer("keyboard", KeyboardSettings, keyboard, needs={"pylsl": LAB})]
