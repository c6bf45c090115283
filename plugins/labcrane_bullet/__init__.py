"""The study's crane: moved by PyBullet, or by its velocity law alone."""

from labcrane import Dynamics, Machine, Offer, hookimpl, offer
from labcrane.core import CraneSettings, LoadedCraneSettings
from labcrane.registry import LAB

labcrane_api = 1

ENGINE = (
    f"{LAB} on Python 3.11, where its wheels end; "
    "or use 'mujoco_crane', or 'kinematic_crane', which needs none"
)


@hookimpl
def labcrane_dynamics() -> list[Offer[Dynamics]]:
    return [
        offer("bullet_crane", LoadedCraneSettings, _bullet_crane, needs={"pybullet": ENGINE}),
        offer("kinematic_crane", CraneSettings, _kinematic_crane),
    ]


def _bullet_crane(settings: LoadedCraneSettings, machine: Machine) -> Dynamics:
    from labcrane_bullet.bullet_crane import BulletCrane
    from labcrane_bullet.loaded_crane import LoadedBulletCrane

    return (LoadedBulletCrane if settings.loaded else BulletCrane)(settings, machine)


def _kinematic_crane(settings: CraneSettings, machine: Machine) -> Dynamics:
    from labcrane_bullet.kinematic_crane import KinematicCrane

    return KinematicCrane(settings, machine)
