"""Daylight: where the sun stands, and the colours of sun, sky, ground and haze."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Colour = tuple[float, float, float]

Time = Literal["day", "evening", "overcast", "dusk"]


@dataclass(frozen=True, slots=True)
class Daylight:
    """Light of a time of day; colours are red, green and blue, 0 to 1 and beyond.

    Attributes
    ----------
    sun
        Direction to the sun, in the machine's base frame.
    sunlight
        What it adds to a surface that faces it.
    above, below
        Light from the sky on what faces up, and from the ground on what faces down.
    haze, zenith
        The sky at the horizon, into which things fade, and straight up.
    thickness
        Of the haze, per metre.
    """

    sun: tuple[float, float, float]
    sunlight: Colour
    above: Colour
    below: Colour
    haze: Colour
    zenith: Colour
    thickness: float


DAYLIGHT: Mapping[Time, Daylight] = {
    "day": Daylight(
        sun=(0.45, -0.38, 0.81),
        sunlight=(1.05, 0.98, 0.86),
        above=(0.50, 0.56, 0.64),
        below=(0.26, 0.24, 0.20),
        haze=(0.66, 0.75, 0.82),
        zenith=(0.42, 0.60, 0.82),
        thickness=0.0125,
    ),
    "evening": Daylight(
        sun=(0.51, 0.68, 0.53),
        sunlight=(1.25, 0.80, 0.44),
        above=(0.40, 0.42, 0.54),
        below=(0.24, 0.19, 0.16),
        haze=(0.87, 0.72, 0.58),
        zenith=(0.38, 0.48, 0.70),
        thickness=0.0145,
    ),
    "overcast": Daylight(
        sun=(0.2, -0.15, 0.97),
        sunlight=(0.16, 0.16, 0.16),
        above=(0.86, 0.88, 0.90),
        below=(0.40, 0.39, 0.37),
        haze=(0.74, 0.76, 0.78),
        zenith=(0.60, 0.63, 0.67),
        thickness=0.02,
    ),
    "dusk": Daylight(
        sun=(0.51, 0.68, 0.47),
        sunlight=(0.20, 0.16, 0.18),
        above=(0.27, 0.30, 0.40),
        below=(0.13, 0.12, 0.12),
        haze=(0.42, 0.40, 0.46),
        zenith=(0.14, 0.18, 0.32),
        thickness=0.017,
    ),
}
"""By time of day; ``day`` is the default."""
