"""A sphere whose size and brightness follow the distance of tip and target."""

import math
from collections.abc import Sequence

import numpy as np

from labcrane import Cue, FloatArray, Frame, Run, Signal
from labcrane.core import Following, Shape, Sphere
from labcrane_sphere.settings import SphereSettings

STEEPNESS = 9.0
"""Of the logarithmic law: a tenth of the range of distance gives the first 28 % of the change."""


class SphereCue(Cue):
    """Radius and brightness are functions of the distance alone."""

    signals: tuple[Signal, ...] = (
        Signal("distance", "m"),
        Signal("radius", "m"),
        Signal("brightness", "1"),
    )

    def __init__(self, settings: SphereSettings) -> None:
        self._settings = settings
        self._opacity = Following(settings.opacity)
        self.signals = (*self.signals, *self._opacity.signals("opacity"))

    def open(self, run: Run) -> None:
        self._tip = run.state.find("tip.position")
        self._target = run.task.find("target.position")
        self._opacity.open(run.axes)

    def draw(self, frame: Frame) -> Sequence[Shape]:
        distance, radius, brightness = self.values(frame)[:3].tolist()
        if math.isnan(distance):
            return ()
        place = frame.task[self._target] if self._settings.at == "target" else None
        x, y, z = (frame.state[self._tip] if place is None else place).tolist()
        red, green, blue = (brightness * part for part in self._settings.colour)
        return (Sphere("sphere", (x, y, z), radius, (red, green, blue, self._opacity.value)),)

    def values(self, frame: Frame) -> FloatArray:
        distance = float(np.linalg.norm(frame.task[self._target] - frame.state[self._tip]))
        self._opacity.shown(frame)
        return np.array([distance, *self.look(distance), *self._opacity.recorded])

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
