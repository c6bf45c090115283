"""Operators without a person: simulated, recorded, and one that goes straight to the target."""

from collections.abc import Sequence

from labcrane import InputDevice, Machine, Offer, hookimpl, offer
from labcrane_operator.settings import OperatorSettings, RecordedSettings, TowardSettings

labcrane_api = 1


@hookimpl
def labcrane_inputs() -> Sequence[Offer[InputDevice]]:
    def simulated(settings: OperatorSettings, machine: Machine) -> InputDevice:
        from labcrane_operator.operator import SimulatedOperator

        return SimulatedOperator(settings)

    def recorded(settings: RecordedSettings, machine: Machine) -> InputDevice:
        from labcrane_operator.recorded import RecordedInput

        return RecordedInput(settings)

    def toward(settings: TowardSettings, machine: Machine) -> InputDevice:
        from labcrane_operator.toward import TowardTarget

        return TowardTarget(settings)

    return (
        offer("simulated_operator", OperatorSettings, simulated),
        offer("recorded", RecordedSettings, recorded),
        offer("toward_target", TowardSettings, toward),
    )
