"""Delay from a recorded change to light and air, from a sensor's samples.

A photodiode on the view's patch sees steps up and down; a microphone hears sounds begin, and an
accelerometer feels vibrations begin. They are found at half of the way, between two samples, so
that a slow sensor adds no delay of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from labcrane.errors import DeviceError
from labcrane.types import FloatArray

EARLY_S = 0.02
"""How long before a change its edge may be: the accuracy of sensors' timestamps."""

QUIET_S = 0.05
"""Silence after which a sound counts as a new one."""

FEWEST = 0.9
"""Minimum share of the changes that the sensor saw."""

CONTRAST = 6.0
"""Minimum distance of a sensor's two levels, in multiples of its noise."""

PIECE_S, SOUND = 0.01, 3.0
"""Length of sound chunks; loud chunks are so many times louder than quiet ones."""

Kind = Literal["display", "audio", "touch"]
"""What a sensor sees, hears or feels."""


@dataclass(frozen=True, slots=True)
class Change:
    """One presented change: its recorded time, and whether it is to bright or loud."""

    time: float
    up: bool


@dataclass(frozen=True, slots=True)
class Delay:
    """From a recorded change to the sensor.

    Attributes
    ----------
    mean_s, sd_s, least_s, most_s
        In seconds.
    seen, asked
        How many changes the sensor saw, and how many there were.
    sensor_hz
        Samples of the sensor per second; a sample is the resolution of the delay.
    """

    mean_s: float
    sd_s: float
    least_s: float
    most_s: float
    seen: int
    asked: int
    sensor_hz: float


def steps(times: FloatArray, values: FloatArray) -> list[Change]:
    """Return the times at which a signal changes between its two levels.

    Parameters
    ----------
    times, values
        The sensor's samples, in seconds and in its own unit, shape ``(n_samples,)``.

    Raises
    ------
    DeviceError
        The signal does not have two levels.
    """
    low, high = np.percentile(values, (5, 95))
    middle = 0.5 * (low + high)
    halves = [values[values <= middle], values[values > middle]]
    wavers = max((float(np.std(half)) for half in halves if len(half)), default=0.0)
    if not high - low > CONTRAST * wavers:
        raise DeviceError(
            f"the sensor's signal does not have two levels: most of it is between {low:g} and "
            f"{high:g}, and it wavers by {wavers:g}; put the photodiode on the square, and shade it"
        )
    near, found = 0.2 * (high - low), []
    bright = bool(values[0] > middle)
    for at in range(1, len(values)):
        # Only a signal that has come near the other level has changed: noise has not.
        if bright != (values[at] > middle) and abs(values[at] - middle) > near:
            bright = not bright
            found.append(Change(_crossing(times, values, at, middle), bright))
    return found


def onsets(times: FloatArray, values: FloatArray) -> list[Change]:
    """Return where sounds begin, as :func:`steps` does for light."""
    loud = np.abs(values - np.median(values))
    starts = np.arange(times[0], times[-1], PIECE_S)
    pieces = np.maximum.reduceat(loud, np.searchsorted(times, starts))
    quiet, most = np.percentile(pieces, (20, 95))
    if not most > SOUND * quiet:
        raise DeviceError(
            f"the sensor notices nothing: {most:g} where it is loud and {quiet:g} where it is not; "
            "put the microphone to the loudspeaker or the accelerometer on the tactor, or turn it "
            "up"
        )
    found: list[Change] = []
    last = -np.inf
    for at in np.flatnonzero(loud > 0.5 * most).tolist():
        if times[at] - last > QUIET_S:
            found.append(Change(_crossing(times, loud, at, 0.5 * most), up=True))
        last = times[at]
    return found


def _crossing(times: FloatArray, values: FloatArray, at: int, level: float) -> float:
    """Return when ``values`` last went through ``level`` before sample ``at``."""
    while at > 1 and (values[at - 1] - level) * (values[at] - level) > 0.0:
        at -= 1
    before, after = float(values[at - 1]), float(values[at])
    share = (level - before) / (after - before) if after != before else 1.0
    return float(times[at - 1] + share * (times[at] - times[at - 1]))


def delay(changes: Sequence[Change], seen: Sequence[Change], sensor_hz: float) -> Delay:
    """Return how long after each change the sensor saw it.

    Every change is matched with the first edge of its kind before the next change.

    Raises
    ------
    DeviceError
        Too many changes have no edge.
    """
    found = []
    ends = [change.time for change in changes[1:]] + [np.inf]
    for change, end in zip(changes, ends, strict=True):
        edges = [
            edge.time - change.time
            for edge in seen
            if edge.up == change.up and change.time - EARLY_S <= edge.time < end - EARLY_S
        ]
        if edges:
            found.append(edges[0])
    if not changes or len(found) < FEWEST * len(changes):
        raise DeviceError(
            f"the sensor saw {len(found)} of {len(changes)} changes; put it where they are, and "
            "keep other light and sound away"
        )
    spread = float(np.std(found, ddof=1)) if len(found) > 1 else 0.0
    return Delay(
        mean_s=float(np.mean(found)),
        sd_s=spread,
        least_s=min(found),
        most_s=max(found),
        seen=len(found),
        asked=len(changes),
        sensor_hz=sensor_hz,
    )
