"""Control panels on a CAN bus: J1939 auxiliary valve commands, or whatever a DBC file describes."""

from labcrane import InputDevice, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_can.settings import CanSettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    panel, examine = "labcrane_can.panel:CanPanel", "labcrane_can.examination:examine"
    needs = {"can": LAB, "cantools": LAB}
    return [offer("can", CanSettings, panel, examine, needs=needs)]
