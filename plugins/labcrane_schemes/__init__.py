"""Control schemes: what the operator's axes ask of the joints."""

from collections.abc import Sequence

from labcrane import Controller, Offer, hookimpl, offer
from labcrane_schemes.settings import (
    EndEffectorSettings,
    JointVelocitySettings,
    SwitchableSettings,
)

labcrane_api = 1


@hookimpl
def labcrane_controllers() -> Sequence[Offer[Controller]]:
    from labcrane_schemes.end_effector import EndEffector
    from labcrane_schemes.joint_velocity import JointVelocity
    from labcrane_schemes.switchable import Switchable

    return (
        offer("joint_velocity", JointVelocitySettings, JointVelocity),
        offer("end_effector", EndEffectorSettings, EndEffector),
        offer("switchable", SwitchableSettings, Switchable),
    )
