"""Law of the vibration: pure functions of where the tip is."""

import math

from labcrane_vibration.settings import VibrationSettings

ON = 0.5
"""Share of a pulse in which it is on."""


def strength(settings: VibrationSettings, distance: float, inside_s: float) -> tuple[float, float]:
    """Return the amplitude, 0 to 1, and the pulses per second, 0 without pulses.

    Parameters
    ----------
    distance
        Distance between tip and target, in metres.
    inside_s
        Time that the tip has been inside the target, in seconds; 0 outside.
    """
    near = 1.0 - min(distance / settings.far, 1.0)
    weak, strong = settings.amplitude
    slow, fast = settings.pulse_hz or (0.0, 0.0)
    silent = settings.silent_after_s is not None and inside_s >= max(settings.silent_after_s, 1e-9)
    return 0.0 if silent else weak + (strong - weak) * near, slow + (fast - slow) * near


def shares(settings: VibrationSettings, ahead: float, left: float) -> tuple[float, ...]:
    """Return the share of the amplitude that each tactor is given, 0 to 1.

    A tactor that stands for the target's direction has 1, one for the opposite direction 0, one
    across a half; all have a half when the tip is above or below the target.

    Parameters
    ----------
    ahead, left
        The horizontal way from the tip to the target, in metres, along x and y.
    """
    length = max(math.hypot(ahead, left), settings.aside)
    return tuple(
        1.0
        if degrees is None
        else 0.5
        + 0.5 * (ahead * math.cos(angle := math.radians(degrees)) + left * math.sin(angle)) / length
        for degrees in settings.tactors.values()
    )
