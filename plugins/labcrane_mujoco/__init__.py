"""The study's crane moved by MuJoCo, which has wheels for every system and Python."""

from labcrane import Dynamics, Machine, Offer, hookimpl, offer
from labcrane.core import LoadedCraneSettings
from labcrane.registry import LAB

labcrane_api = 1

ENGINE = f"{LAB}; or use 'kinematic_crane', which needs no engine"


@hookimpl
def labcrane_dynamics() -> list[Offer[Dynamics]]:
    return [
        offer("mujoco_crane", LoadedCraneSettings, _mujoco_crane, needs={"mujoco": ENGINE}),
    ]


def _mujoco_crane(settings: LoadedCraneSettings, machine: Machine) -> Dynamics:
    from labcrane_mujoco.loaded_crane import GrappleCrane, LoadedMujocoCrane
    from labcrane_mujoco.mujoco_crane import MujocoCrane

    if settings.grapple is not None:
        return GrappleCrane(settings, machine)
    return (LoadedMujocoCrane if settings.loaded else MujocoCrane)(settings, machine)
