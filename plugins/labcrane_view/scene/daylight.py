"""Daylight: where the sun stands, and the colours of sun, sky, ground and haze."""

from dataclasses import dataclass

Colour = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Daylight:
    """Light of a day; colours are red, green and blue, 0 to 1 and beyond.

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


DAY = Daylight(
    sun=(0.45, -0.38, 0.81),
    sunlight=(1.05, 0.98, 0.86),
    above=(0.50, 0.56, 0.64),
    below=(0.26, 0.24, 0.20),
    haze=(0.66, 0.75, 0.82),
    zenith=(0.42, 0.60, 0.82),
    thickness=0.0125,
)
