"""Hanging load on the tip, as URDF text, and where it is."""

import math
from collections.abc import Sequence

from labcrane import Machine
from labcrane_bullet.settings import BulletSettings, GrappleSettings

SWIVEL_KG = 0.01
"""Of the link between both hinges: engines need some mass, and this sways nothing."""

Vector = tuple[float, float, float]


def hanging(machine: Machine, settings: BulletSettings) -> str:
    """Return links and joints behind the crane's last link.

    A grapple hangs on two hinges that nothing drives: about the pitch axis, and across it.
    """
    last = machine.joints[-1]
    tip = f'<origin xyz="{last.a!r} 0 0"/>'
    grapple = settings.grapple
    if grapple is None:
        return _link("payload", settings.payload_kg, last.thickness, 0.0) + (
            f'<joint name="payload" type="fixed"><parent link="{last.name}"/>'
            f'<child link="payload"/>{tip}</joint>'
        )
    return (
        _link("swivel", SWIVEL_KG, 0.1, 0.0)
        + _hinge("swivel", last.name, tip, "0 1 0")
        + _link("grapple", total_kg(settings), grapple.size_m, -grapple.length_m)
        + _hinge("grapple", "swivel", "", "1 0 0")
    )


def total_kg(settings: BulletSettings) -> float:
    """Return the mass of grapple and payload, in kg."""
    return settings.payload_kg + (settings.grapple.mass_kg if settings.grapple else 0.0)


def inertia(mass: float, edge: float) -> float:
    """Return the moment of inertia of a cube about an axis through its centre, in kg m²."""
    return mass * edge * edge / 6.0


def place(
    grapple: GrappleSettings, tip: Sequence[float], bearing: float, along: float, across: float
) -> tuple[float, ...]:
    """Return the grapple's centre in m, and its orientation as a quaternion x, y, z, w.

    ``along`` is its swing outward, ``across`` to the left, in rad.
    """
    out = grapple.length_m * math.sin(along) * math.cos(across)
    left = grapple.length_m * math.sin(across)
    down = grapple.length_m * math.cos(along) * math.cos(across)
    ahead, aside = math.cos(bearing), math.sin(bearing)
    x, y, z = tip
    position = (x + out * ahead - left * aside, y + out * aside + left * ahead, z - down)
    (sz, cz), (sy, cy), (sx, cx) = (
        (math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in (bearing, -along, across)
    )
    return (
        *position,
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz - sx * sy * cz,
        cx * cy * cz + sx * sy * sz,
    )


def _link(name: str, mass: float, edge: float, height: float) -> str:
    about = inertia(mass, edge)
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {height!r}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{about!r}" iyy="{about!r}" izz="{about!r}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
    )


def _hinge(name: str, parent: str, origin: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{name}"/>'
        f'{origin}<axis xyz="{axis}"/></joint>'
    )
