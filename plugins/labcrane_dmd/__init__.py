"""Dynamic Model Descriptions: make them from recordings, and operate an arm that moves by one."""

from pathlib import Path
from typing import TYPE_CHECKING

from labcrane import Controller, Dynamics, Offer, hookimpl, offer
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
    return [offer("valve", ValveSettings, "labcrane_dmd.arm.valve:Valve")]


@hookimpl
def labcrane_dynamics() -> list[Offer[Dynamics]]:
    arm = "labcrane_dmd.arm.arm:DmdArm"
    return [offer("dmd_arm", ArmSettings, arm, needs={"pybullet": ENGINE})]
