"""The open gateway protocol: any program with LSL can be the control station."""

from labcrane import InputDevice, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_gateway.settings import GatewaySettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    station = "labcrane_gateway.station:Station"
    return [offer("gateway", GatewaySettings, station, needs={"pylsl": LAB})]
