"""The open gateway protocol: any program with LSL can be the control station."""

from labcrane import InputDevice, Machine, Offer, hookimpl, offer
from labcrane.registry import LAB
from labcrane_gateway.settings import GatewaySettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    def gateway(settings: GatewaySettings, machine: Machine) -> InputDevice:
        from labcrane_gateway.station import Station

        return Station(settings, machine)

    return [offer("gateway", GatewaySettings, gateway, needs={"pylsl": LAB})]
