"""Control schemes: how the operator's axes command the joints."""

from collections.abc import Sequence

from labcrane import Controller, Machine, Offer, hookimpl, offer
from labcrane_schemes.settings import (
    EndEffectorSettings,
    JointVelocitySettings,
    SwitchableSettings,
)

labcrane_api = 1


@hookimpl
def labcrane_controllers() -> Sequence[Offer[Controller]]:
    def joint_velocity(settings: JointVelocitySettings, machine: Machine) -> Controller:
        from labcrane_schemes.joint_velocity import JointVelocity

        return JointVelocity(settings, machine)

    def end_effector(settings: EndEffectorSettings, machine: Machine) -> Controller:
        from labcrane_schemes.end_effector import EndEffector

        return EndEffector(settings, machine)

    def switchable(settings: SwitchableSettings, machine: Machine) -> Controller:
        from labcrane_schemes.switchable import Switchable

        return Switchable(settings, machine)

    return (
        offer("joint_velocity", JointVelocitySettings, joint_velocity),
        offer("end_effector", EndEffectorSettings, end_effector),
        offer("switchable", SwitchableSettings, switchable),
    )
