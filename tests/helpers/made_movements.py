"""Movements as people make them, joint after joint with halts, and what is true of each."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

LINKS = (2.9, 2.8, 2.8)
REST = np.radians([0.0, 50.0, -60.0, -20.0])
FINE_HZ = 20_000.0
RATES_HZ = (30.0, 60.0, 100.0, 240.0, 1000.0)


@dataclass(frozen=True)
class Made:
    """A movement as it was made: the strokes of its joints, one after the other.

    Attributes
    ----------
    begins, lasts
        Of each stroke, in s, shape ``(n,)``; it is a movement of least jerk of one joint.
    joint, turn
        Which joint moves, from 0, and by how much, in rad.
    before, after
        How long nothing moves at either end, in s.
    tremor
        Of the joint that moves, as a share of its speed, at ``tremor_hz``.
    """

    begins: np.ndarray
    lasts: np.ndarray
    joint: np.ndarray
    turn: np.ndarray
    before: float
    after: float
    tremor: float = 0.0
    tremor_hz: float = 8.0

    @property
    def ends(self) -> float:
        """When the last stroke has ended, in s."""
        return float((self.begins + self.lasts).max())

    def angles(self, time: np.ndarray) -> np.ndarray:
        """Return the joints' angles in rad, shape ``(n, 4)``."""
        angles = np.tile(REST, (len(time), 1))
        for begins, lasts, joint, turn in zip(
            self.begins, self.lasts, self.joint, self.turn, strict=True
        ):
            s = np.clip((time - begins) / lasts, 0.0, 1.0)
            shake = self.tremor * 30.0 * s**2 * (1.0 - s) ** 2 / lasts
            wave = np.sin(2.0 * np.pi * self.tremor_hz * (time - begins))
            way = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            angles[:, joint] += turn * (way + shake * wave / (2.0 * np.pi * self.tremor_hz))
        return angles

    def tip(self, time: np.ndarray) -> np.ndarray:
        """Return where the tip is, in m, shape ``(n, 3)``."""
        slew, *bends = self.angles(time).T
        sums = np.cumsum(bends, axis=0)
        out = sum(link * np.cos(angle) for link, angle in zip(LINKS, sums, strict=True))
        up = sum(link * np.sin(angle) for link, angle in zip(LINKS, sums, strict=True))
        return np.column_stack([out * np.cos(slew), out * np.sin(slew), up])

    def sampled(self, rate_hz: float) -> np.ndarray:
        """Return the times of samples, to ``after`` behind the last stroke."""
        return np.arange(0.0, self.ends + self.after, 1.0 / rate_hz)

    def speed(self, time: np.ndarray) -> np.ndarray:
        """Return the tip's true speed in m/s, shape ``(n,)``."""
        half = 0.5 / FINE_HZ
        way = self.tip(time + half) - self.tip(time - half)
        return np.linalg.norm(way, axis=1) * FINE_HZ

    def still(self, threshold: float) -> np.ndarray:
        """Return from when to when it is slower than a threshold, in s, shape ``(n, 2)``."""
        time = self.sampled(2000.0)
        slow = self.speed(time) <= threshold
        turns = np.flatnonzero(np.diff(slow, prepend=False, append=False))
        return np.append(time, time[-1])[turns].reshape(-1, 2)


def made(random: np.random.Generator, *, halting: bool = True) -> Made:
    """Draw a movement of two to five strokes, with halts of 0 to 1 s or overlapping."""
    number = int(random.integers(2, 6))
    lasts = random.uniform(0.6, 1.6, number)
    gaps = (
        random.uniform(0.0, 1.0, number - 1) if halting else -lasts[1:] * random.uniform(0.2, 0.6)
    )
    before = random.uniform(0.4, 1.0)
    begins = before + np.concatenate([[0.0], np.cumsum(lasts[:-1] + gaps)])
    first = int(random.integers(4))
    return Made(
        begins=np.maximum(begins, before),
        lasts=lasts,
        joint=(first + np.arange(number)) % 4,
        turn=random.uniform(0.15, 0.5, number) * random.choice([-1.0, 1.0], number),
        before=before,
        after=1.0,
        tremor=float(random.choice([0.0, 0.1])),
        tremor_hz=random.uniform(6.0, 10.0),
    )


def drawn(seed: int, count: int, **how: bool) -> Iterator[tuple[np.random.Generator, Made]]:
    """Yield movements, and what else is to be drawn from."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield random, made(random, **how)
