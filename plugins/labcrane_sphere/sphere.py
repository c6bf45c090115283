"""A sphere whose size and brightness follow the distance of tip and target."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from labcrane import Ball, Cue, FloatArray, Frame, Run, Settings, Shape, Signal

STEEPNESS = 9.0
"""Of the logarithmic law: a tenth of the range of distance gives the first 28 % of the change."""


class SphereSettings(Settings):
    """Where the sphere is, and how it follows the distance.

    The published study names brightness and size, not their laws: these are a proposal.
    """

    at: Literal["target", "tip"] = "target"
    """Where it is drawn."""

    far: PositiveFloat = 4.0
    """Distance of tip and target, in metres, from which on the sphere stays as it is."""

    law: Literal["linear", "log"] = "linear"
    """How it changes with distance; ``log`` changes most near the target."""

    polarity: Literal["shrinks", "grows"] = "shrinks"
    """What its size does as the tip comes closer."""

    brightness: Literal["brightens", "darkens", "constant"] = "brightens"
    """What its brightness does as the tip comes closer."""

    smallest: PositiveFloat = 0.15
    """Smallest radius, in metres."""

    largest: PositiveFloat = 0.60
    """Largest radius, in metres."""

    darkest: NonNegativeFloat = Field(default=0.25, lt=1.0)
    """Smallest brightness, 1 being the full colour."""

    colour: tuple[float, float, float] = (0.15, 0.75, 1.0)
    """Red, green and blue at full brightness, each 0 to 1."""

    opacity: float = Field(default=0.45, gt=0.0, le=1.0)
    """1 hides what is behind it."""

    @model_validator(mode="after")
    def _sizes_rise(self) -> "SphereSettings":
        if self.smallest > self.largest:
            raise ValueError(
                f"smallest is {self.smallest:g} m and largest {self.largest:g} m; exchange them"
            )
        return self


class Sphere(Cue):
    """Radius and brightness are functions of the distance alone."""

    signals = (Signal("distance", "m"), Signal("radius", "m"), Signal("brightness", "1"))

    def __init__(self, settings: SphereSettings) -> None:
        self._settings = settings

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")

    def draw(self, frame: Frame) -> Sequence[Shape]:
        distance, radius, brightness = self.values(frame).tolist()
        if math.isnan(distance):
            return ()
        place = frame.task[self._target] if self._settings.at == "target" else None
        x, y, z = (frame.state[self._tip] if place is None else place).tolist()
        red, green, blue = (brightness * part for part in self._settings.colour)
        return (Ball("sphere", (x, y, z), radius, (red, green, blue, self._settings.opacity)),)

    def values(self, frame: Frame) -> FloatArray:
        distance = float(np.linalg.norm(frame.task[self._target] - frame.state[self._tip]))
        return np.array([distance, *self.look(distance)])

    def look(self, distance: float) -> tuple[float, float]:
        """Return radius in metres and brightness at a distance in metres; NaN at NaN."""
        settings = self._settings
        away = distance / settings.far
        away = min(away, 1.0)
        if settings.law == "log":
            away = math.log1p(STEEPNESS * away) / math.log1p(STEEPNESS)
        size = away if settings.polarity == "shrinks" else 1.0 - away
        radius = settings.smallest + (settings.largest - settings.smallest) * size
        light = {"brightens": 1.0 - away, "darkens": away, "constant": 1.0}[settings.brightness]
        return radius, settings.darkest + (1.0 - settings.darkest) * light
