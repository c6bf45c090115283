"""Forest around the machine: ground, trees and a stack of logs. Always the same."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labcrane import FloatArray
from labcrane_view.scene.mesh import Mesh, cone, flat, joined

SEED = 5
CLEARING = 15.0
"""Metres around the machine that are free and level, so that nothing is in the way of the tip."""

TIERS, BOUGHS = 8, 7
"""Tiers of a spruce, and boughs in each."""

GAP, GAP_END = 0.2, 26.0
"""Half the angle in rad, and the end in metres, of a gap ahead through which the hills are seen."""


Point = tuple[float, float, float]


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
        Thing("logs", _logs(), (0.36, 0.27, 0.19, 1.0), 0.5),
        Thing("ends of logs", _ends(), (0.72, 0.57, 0.38, 1.0), 0.0),
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
    shape = np.random.default_rng(SEED + 1)
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
        for tier in range(TIERS):
            share = tier / TIERS
            low = foot + tall * (0.20 + 0.74 * share)
            wide = tall * (0.17 * (1.0 - share) + 0.02) * shape.uniform(0.85, 1.1)
            crowns.append(_boughs((x, y, low), wide, 0.17 * tall, shape))
    return joined(*trunks), joined(*crowns)


def _boughs(
    foot: tuple[float, float, float], wide: float, high: float, random: np.random.Generator
) -> Mesh:
    """Return a tier of a spruce: boughs that hang, of different lengths, around the trunk."""
    turns = np.arange(2 * BOUGHS) * math.pi / BOUGHS + random.uniform(0.0, math.pi)
    reach = np.where(np.arange(2 * BOUGHS) % 2 == 0, 1.0, 0.55)
    reach = wide * reach * random.uniform(0.8, 1.15, 2 * BOUGHS)
    down = np.where(np.arange(2 * BOUGHS) % 2 == 0, -0.10, 0.16) * high
    rim = np.stack([reach * np.cos(turns), reach * np.sin(turns), down], axis=1)
    points = np.vstack([rim, [0.0, 0.0, high], [0.0, 0.0, 0.25 * high]]) + np.array(foot)
    one = np.arange(2 * BOUGHS)
    after = (one + 1) % (2 * BOUGHS)
    above = np.stack([one, after, np.full_like(one, 2 * BOUGHS)], axis=1)
    below = np.stack([after, one, np.full_like(one, 2 * BOUGHS + 1)], axis=1)
    return flat(points, np.vstack([above, below]).astype(np.uint32))


def grid(reach: int = 12, radius: float = 0.012) -> Mesh:
    """Return bars on the ground, a metre apart, to ``reach`` metres on each side of the machine."""
    lines = []
    for number in range(-reach, reach + 1):
        far = math.sqrt(max(reach * reach - number * number, 0.01))
        lines.append(cone((number, -far, 0.0), (number, far, 0.0), (radius, radius), 4))
        lines.append(cone((-far, number, 0.0), (far, number, 0.0), (radius, radius), 4))
    return joined(*lines)


def _logs() -> Mesh:
    return joined(*(cone(start, end, radii, 14) for start, end, radii in _stack()))


def _ends() -> Mesh:
    """Return the sawn ends of the logs, a little in front of the bark."""
    ends = []
    for start, end, (butt, top) in _stack():
        way = (np.array(end) - start) / np.linalg.norm(np.array(end) - start)
        for place, out, radius in ((np.array(start), -way, butt), (np.array(end), way, top)):
            near, far = (place + share * out for share in (-0.01, 0.006))
            ends.append(cone(tuple(near), tuple(far), (0.9 * radius, 0.9 * radius), 14))
    return joined(*ends)


def _stack() -> Iterator[tuple[Point, Point, tuple[float, float]]]:
    """Yield both ends of each log, and its radii there."""
    random = np.random.default_rng(SEED)
    stack = [(0.42 * n, 0.20) for n in range(5)] + [(0.21 + 0.42 * n, 0.56) for n in range(4)]
    stack += [(0.42 + 0.42 * n, 0.92) for n in range(3)]
    for aside, up in stack:
        ahead, thick = random.uniform(-0.2, 0.2), random.uniform(0.17, 0.21)
        start = (3.0 + ahead, -9.6 + aside, up)
        yield start, (7.2 + ahead, -9.4 + aside, up), (thick, 0.9 * thick)
