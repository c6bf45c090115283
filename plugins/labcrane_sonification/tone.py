"""Tone as a pure function of where the tip is."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import lru_cache

import numpy as np

from labcrane import FloatArray
from labcrane_sonification.settings import SonificationSettings, sum_of_partials


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
        Distance between tip and target, in metres.
    aside
        Distance of the target to the left of the tip, in metres.
    inside_s
        Time that the tip has been inside the target, in seconds; 0 outside.
    """
    near = 1.0 - min(distance / settings.far, 1.0)
    low, high = settings.pitch_hz
    few, many = settings.overtones
    quiet, loud = settings.level
    silent = settings.silent_after_s is not None and inside_s >= max(settings.silent_after_s, 1e-9)
    pitch = low * (high / low) ** near
    overtones = float(round(few + (many - few) * near))
    level = quiet + (loud - quiet) * near
    if settings.weighting == "a":
        level *= softest(settings.pitch_hz, settings.overtones) / heard(pitch, overtones)
    side = {"towards": -1.0, "away": 1.0, "none": 0.0}[settings.pan] * aside / settings.aside
    return Tone(
        pitch=pitch,
        overtones=overtones,
        level=0.0 if silent else level,
        pan=max(-1.0, min(1.0, side)),
    )


STEPS = 400
"""Number of distances at which the softest and the loudest tone are searched for."""


def loudest(settings: SonificationSettings) -> tuple[float, float]:
    """Return the largest sum of the partials' amplitudes, and at which distance in metres it is.

    No sample is larger, however the partials lie to each other; ``weighting`` can only lower it.
    """
    with np.errstate(all="ignore"):  # of inaudible pitches, about which a check warns
        if not softest(settings.pitch_hz, settings.overtones) > 0.0:
            return max(settings.level) * sum_of_partials(max(settings.overtones)), 0.0
        ways: Sequence[float] = np.linspace(0.0, settings.far, STEPS + 1).tolist()
        tones = [(tone(settings, distance, 0.0, 0.0), distance) for distance in ways]
    return max((made.level * sum_of_partials(int(made.overtones)), at) for made, at in tones)


def weighted(hertz: FloatArray) -> FloatArray:
    """Return the A-weighting of frequencies as a factor of amplitude; 1 at 1 kHz.

    IEC 61672-1, annex E.
    """
    squared = np.square(hertz)
    poles = (20.598997, 107.65265, 737.86223, 12194.217)
    first, second, third, fourth = (squared + pole**2 for pole in poles)
    response = poles[3] ** 2 * squared**2 / (first * np.sqrt(second * third) * fourth)
    return np.asarray(1.2588966 * response)  # +2.00 dB


def heard(pitch: float, overtones: float) -> float:
    """Return the A-weighted amplitude of a tone whose fundamental has an amplitude of 1.

    That of a sine of 1 kHz that is as loud: powers of partials add.
    """
    numbers = np.arange(1.0, 2.0 + overtones)
    return float(np.linalg.norm(weighted(pitch * numbers) / numbers))


@lru_cache(maxsize=16)
def softest(pitch_hz: tuple[float, float], overtones: tuple[int, int]) -> float:
    """Return what is heard of the tone where it is softest, its fundamental having 1."""
    (low, high), (few, many) = pitch_hz, overtones
    ways: Sequence[float] = np.linspace(0.0, 1.0, STEPS + 1).tolist()
    return min(heard(low * (high / low) ** at, round(few + (many - few) * at)) for at in ways)


def gains(pan: float) -> tuple[float, float]:
    """Return the gains of the left and the right channel: their power is the same everywhere."""
    angle = (pan + 1.0) * math.pi / 4.0
    return math.cos(angle), math.sin(angle)
