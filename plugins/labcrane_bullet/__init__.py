"""The study's crane: moved by PyBullet, or by its velocity law alone."""

from labcrane import Dynamics, Machine, Offer, PluginError, hookimpl, offer
from labcrane_bullet.settings import BulletSettings, CraneSettings

labcrane_api = 1


@hookimpl
def labcrane_dynamics() -> list[Offer[Dynamics]]:
    return [
        offer("bullet_crane", BulletSettings, _bullet_crane),
        offer("kinematic_crane", CraneSettings, _kinematic_crane),
    ]


def _bullet_crane(settings: BulletSettings, machine: Machine) -> Dynamics:
    try:
        from labcrane_bullet.bullet_crane import BulletCrane
        from labcrane_bullet.loaded_crane import LoadedCrane
    except ModuleNotFoundError as error:
        if error.name != "pybullet":
            raise
        raise PluginError(
            "'bullet_crane' needs PyBullet, which is not installed (its wheels end at Python "
            "3.11); use 'kinematic_crane', which needs no engine, or install pybullet"
        ) from error
    return (LoadedCrane if settings.loaded else BulletCrane)(settings, machine)


def _kinematic_crane(settings: CraneSettings, machine: Machine) -> Dynamics:
    from labcrane_bullet.kinematic_crane import KinematicCrane

    return KinematicCrane(settings, machine)
