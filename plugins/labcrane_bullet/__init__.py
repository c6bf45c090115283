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
    kinematic = "labcrane_bullet.kinematic_crane:KinematicCrane"
    return [
        offer("bullet_crane", LoadedCraneSettings, _bullet_crane, needs={"pybullet": ENGINE}),
        offer("kinematic_crane", CraneSettings, kinematic),
    ]


def _bullet_crane(settings: LoadedCraneSettings, machine: Machine) -> Dynamics:
    from labcrane_bullet.bullet_crane import BulletCrane
    from labcrane_bullet.loaded_crane import LoadedBulletCrane

    return (LoadedBulletCrane if settings.loaded else BulletCrane)(settings, machine)
