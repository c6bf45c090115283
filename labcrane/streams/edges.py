"""Edges in a sensor's samples, and how long after a recorded change they come.

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
    # Only a signal that has come near the other level has changed: noise has not.
    clear = np.flatnonzero(np.abs(values - middle) > 0.2 * (high - low))
    bright = np.r_[values[0] > middle, values[clear] > middle]
    at = clear[bright[1:] != bright[:-1]]
    return [Change(_crossing(times, values, k, middle), bool(values[k] > middle)) for k in at]


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
    late = np.full(len(changes), np.nan)
    ends = np.r_[[change.time for change in changes[1:]], np.inf]
    for up in (True, False):
        edges = np.array([edge.time for edge in seen if edge.up == up])
        for k, change in enumerate(changes):
            at = int(np.searchsorted(edges, change.time - EARLY_S))
            if change.up == up and at < len(edges) and edges[at] < ends[k] - EARLY_S:
                late[k] = edges[at] - change.time
    return in_short(late, sensor_hz)


def in_short(late: FloatArray, sensor_hz: float) -> Delay:
    """Return delays in short; NaN is a change that the sensor did not see.

    Raises
    ------
    DeviceError
        These are too many.
    """
    found = late[np.isfinite(late)]
    if not len(found) or len(found) < FEWEST * len(late):
        raise DeviceError(
            f"the sensor saw {len(found)} of {len(late)} changes; put it where they are, and "
            "keep other light and sound away"
        )
    return Delay(
        mean_s=float(found.mean()),
        sd_s=float(found.std(ddof=1)) if len(found) > 1 else 0.0,
        least_s=float(found.min()),
        most_s=float(found.max()),
        seen=len(found),
        asked=len(late),
        sensor_hz=sensor_hz,
    )
