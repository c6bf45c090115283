"""Forest around the machine: ground, trees and a stack of logs. Always the same."""

import math
from dataclasses import dataclass

import numpy as np

from labcrane import FloatArray
from labcrane_view.scene.mesh import Mesh, cone, joined

SEED = 5
CLEARING = 15.0
"""Metres around the machine that are free and level, so that nothing is in the way of the tip."""

GAP, GAP_END = 0.2, 26.0
"""Half the angle in rad, and the end in metres, of a gap ahead through which the hills are seen."""


@dataclass(frozen=True)
class Thing:
    """A mesh that does not move, with its colour and how coarse its surface looks, 0 to 1."""

    name: str
    mesh: Mesh
    colour: tuple[float, float, float, float]
    grain: float


def forest() -> tuple[Thing, ...]:
    """Return everything around the machine."""
    trunks, crowns = _trees(90)
    return (
        Thing("ground", ground(), (0.33, 0.38, 0.19, 1.0), 1.0),
        Thing("trunks", trunks, (0.34, 0.25, 0.17, 1.0), 0.5),
        Thing("crowns", crowns, (0.10, 0.24, 0.11, 1.0), 0.5),
        Thing("logs", _logs(), (0.50, 0.37, 0.23, 1.0), 0.5),
    )


def height(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the height of the ground in metres: level in the clearing, hills behind."""
    away = np.hypot(x, y)
    waves = ((0.5, 0.11, 1.0, 2.0), (0.25, 0.23, 0.3, 1.1), (0.1, 0.51, 2.0, 0.2))
    hills = sum(
        size * np.sin(x * rate + p) * np.cos(y * rate * 0.9 + q) for size, rate, p, q in waves
    )
    rise = 3.0 * np.clip((away - 30.0) / 30.0, 0.0, 1.0)
    return np.asarray(hills * np.clip((away - CLEARING + 2.0) / 12.0, 0.0, 1.0) + rise)


def ground(cells: int = 72, edge: float = 150.0) -> Mesh:
    """Return the ground as a net of ``cells`` by ``cells`` squares."""
    line = np.linspace(-edge / 2, edge / 2, cells + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = height(x, y)
    slope_x, slope_y = np.gradient(z, line, line)
    normals = np.stack([-slope_x, -slope_y, np.ones_like(z)], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    across = first + cells + 1
    faces = np.stack(
        [np.stack([first, across, across + 1], 1), np.stack([first, across + 1, first + 1], 1)], 1
    )
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return Mesh(points, normals, faces.reshape(-1, 3).astype(np.uint32))


def _trees(count: int) -> tuple[Mesh, Mesh]:
    random = np.random.default_rng(SEED)
    trunks: list[Mesh] = []
    crowns: list[Mesh] = []
    while len(trunks) < count:
        x, y = random.uniform(-48.0, 48.0, 2)
        tall = random.uniform(9.0, 16.0)
        gap = abs(math.atan2(y, x)) < GAP and x < GAP_END
        if math.hypot(x, y) < CLEARING + 0.17 * tall or gap:
            continue
        foot = float(height(np.array(x), np.array(y))) - 0.3
        thick = 0.016 * tall
        top = (x, y, foot + 0.9 * tall)
        trunks.append(cone((x, y, foot), top, (thick, 0.4 * thick), sides=8))
        for tier in range(5):
            low = foot + tall * (0.22 + 0.15 * tier)
            wide = tall * (0.165 - 0.028 * tier)
            crowns.append(cone((x, y, low), (x, y, low + 0.24 * tall), (wide, 0.02), sides=9))
    return joined(*trunks), joined(*crowns)


def _logs() -> Mesh:
    random = np.random.default_rng(SEED)
    stack = [(0.42 * n, 0.20) for n in range(5)] + [(0.21 + 0.42 * n, 0.56) for n in range(4)]
    stack += [(0.42 + 0.42 * n, 0.92) for n in range(3)]
    logs = []
    for aside, up in stack:
        ahead, thick = random.uniform(-0.2, 0.2), random.uniform(0.17, 0.21)
        start = (3.0 + ahead, -9.6 + aside, up)
        logs.append(cone(start, (7.2 + ahead, -9.4 + aside, up), (thick, 0.9 * thick), 14))
    return joined(*logs)
