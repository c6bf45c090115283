"""Control panels on a CAN bus: J1939 auxiliary valve commands, or whatever a DBC file describes."""

from collections.abc import Sequence

from labcrane import InputDevice, Machine, Offer, hookimpl, offer
from labcrane.core import Finding
from labcrane.registry import LAB, CommandOffer, Prompt
from labcrane_can.settings import CanSettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> list[Offer[InputDevice]]:
    def panel(settings: CanSettings, machine: Machine) -> InputDevice:
        from labcrane_can.panel import CanPanel

        return CanPanel(settings, machine)

    def examine(settings: CanSettings, ask: Prompt | None) -> Sequence[Finding]:
        from labcrane_can import examination

        return examination.examine(settings, ask)

    needs = {"can": LAB, "cantools": LAB}
    return [offer("can", CanSettings, panel, examine, needs=needs)]


@hookimpl
def labcrane_commands() -> list[CommandOffer]:
    from labcrane_can import commands

    return [CommandOffer(("gateway", "can"), commands.can)]
