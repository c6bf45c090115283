"""Settings of a control station behind the open gateway protocol."""

from pydantic import Field, PositiveFloat

from labcrane import Machine, Settings
from labcrane.core import Names


class GatewaySettings(Settings):
    """Settings of :class:`labcrane_gateway.station.Station`."""

    stream: str = Field(default="gateway.command", min_length=1)
    """Name of the LSL stream with the commands."""

    flow: str = Field(default="gateway.flow", min_length=1)
    """Name of the LSL stream that sends the valves' flow."""

    timeout_s: PositiveFloat = 0.25
    """Age of the last command, in seconds, at which all valves shut and the station is lost."""

    def provides(self, machine: Machine) -> Names:
        return {"axis": [*(f"valve.{name}" for name in machine.names), "panel.connected"]}
