"""Tone as a pure function of where the tip is."""

import math
from dataclasses import astuple, dataclass

import numpy as np

from labcrane import FloatArray
from labcrane_sonification.settings import SonificationSettings


@dataclass(frozen=True, slots=True)
class Tone:
    """A sound to be made.

    Attributes
    ----------
    pitch
        Fundamental in Hz.
    overtones
        How many there are above it; the ``n``-th partial has ``1 / n`` of the level.
    level
        Amplitude of the fundamental, 0 for silence.
    pan
        -1 left, 0 middle, 1 right.
    """

    pitch: float
    overtones: float
    level: float
    pan: float

    @property
    def values(self) -> FloatArray:
        """As an array, shape ``(4,)``."""
        return np.array(astuple(self))


def tone(settings: SonificationSettings, distance: float, aside: float, inside_s: float) -> Tone:
    """Return the tone.

    Parameters
    ----------
    distance
        Of tip and target, in metres.
    aside
        How far the target is to the left of the tip, in metres.
    inside_s
        For how long the tip has been inside the target, in seconds; 0 outside.
    """
    near = 1.0 - min(distance / settings.far, 1.0)
    low, high = settings.pitch_hz
    few, many = settings.overtones
    quiet, loud = settings.level
    silent = settings.silent_after_s is not None and inside_s >= max(settings.silent_after_s, 1e-9)
    side = {"towards": -1.0, "away": 1.0, "none": 0.0}[settings.pan] * aside / settings.aside
    return Tone(
        pitch=low * (high / low) ** near,
        overtones=float(round(few + (many - few) * near)),
        level=0.0 if silent else quiet + (loud - quiet) * near,
        pan=max(-1.0, min(1.0, side)),
    )


def gains(pan: float) -> tuple[float, float]:
    """Return the gains of the left and the right channel: their power is the same everywhere."""
    angle = (pan + 1.0) * math.pi / 4.0
    return math.cos(angle), math.sin(angle)
