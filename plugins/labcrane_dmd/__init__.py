"""Dynamic Model Descriptions: make them from recordings, and operate an arm that moves by one."""

from pathlib import Path
from typing import TYPE_CHECKING

from labcrane import Controller, Dynamics, Machine, Offer, hookimpl, offer
from labcrane.registry import LAB, CommandOffer
from labcrane_dmd.arm.settings import ArmSettings, ValveSettings

if TYPE_CHECKING:
    from labcrane_dmd.model.model import Model
    from labcrane_dmd.model.settings import Between

labcrane_api = 1

ENGINE = f"{LAB} on Python 3.11, where its wheels end"


def load(path: Path | str, between: "Between | None" = None) -> "Model":
    """Read a model: ``load(path)["boom"].speed(signal, angle)`` in rad and rad/s."""
    from labcrane_dmd.model.model_file import load as read

    return read(path, between)


@hookimpl
def labcrane_commands() -> list[CommandOffer]:
    from labcrane_dmd import commands

    return [
        CommandOffer(("dmd", "fit"), commands.fit),
        CommandOffer(("dmd", "validate"), commands.validate),
        CommandOffer(("dmd", "plot"), commands.plot),
    ]


@hookimpl
def labcrane_controllers() -> list[Offer[Controller]]:
    def valve(settings: ValveSettings, machine: Machine) -> Controller:
        from labcrane_dmd.arm.valve import Valve

        return Valve(settings, machine)

    return [offer("valve", ValveSettings, valve)]


@hookimpl
def labcrane_dynamics() -> list[Offer[Dynamics]]:
    def arm(settings: ArmSettings, machine: Machine) -> Dynamics:
        from labcrane_dmd.arm.arm import DmdArm

        return DmdArm(settings, machine)

    return [offer("dmd_arm", ArmSettings, arm, needs={"pybullet": ENGINE})]
