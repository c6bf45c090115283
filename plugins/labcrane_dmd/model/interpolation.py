"""One layer of a model: speed over angle at one signal."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

FULL = 250.0
"""Signal for full flow: 100 % in steps of 0.4 %."""


@dataclass(frozen=True, slots=True)
class Layer:
    """A polynomial of speed over angle, good for the angles that it covers.

    Attributes
    ----------
    signal
        Valve signal, with its sign.
    covers
        Lowest and highest angle, in rad: the measured ones, and where the joint set off, those of
        the next weaker layer.
    whole
        Whether these are, but for the run-up, all angles of the joint.
    coefficients
        In rad/s, of 1, x, x², ...; x goes from -1 to 1 over the covered angles. None at all for
        a signal at which the joint stands still.
    """

    signal: float
    covers: tuple[float, float]
    whole: bool
    coefficients: tuple[float, ...]

    def speed(self, angle: float) -> float:
        """Return the speed in rad/s at ``angle`` in rad; beyond the covered ones, the end's."""
        lowest, highest = self.covers
        x = (2.0 * angle - lowest - highest) / (highest - lowest)
        x = 1.0 if x > 1.0 else -1.0 if x < -1.0 else x
        value = 0.0
        for coefficient in reversed(self.coefficients):
            value = value * x + coefficient
        return value


def linear(at: float, signals: Sequence[float], speeds: Sequence[float]) -> float:
    """Return the speed at a signal within ``signals``, which rise, on a line between neighbours."""
    left = _left(at, signals)
    share = (at - signals[left]) / (signals[left + 1] - signals[left])
    return speeds[left] + share * (speeds[left + 1] - speeds[left])


def pchip(at: float, signals: Sequence[float], speeds: Sequence[float]) -> float:
    """Return the speed at a signal within ``signals``, which rise, on a monotone cubic.

    Slopes at the signals are the weighted harmonic means of Fritsch and Butland (1984), and at the
    ends those of the parabola through three points, held back where they would overshoot.
    """
    left = _left(at, signals)
    width = signals[left + 1] - signals[left]
    start, end = _slope(left, signals, speeds), _slope(left + 1, signals, speeds)
    t = (at - signals[left]) / width
    rise = speeds[left + 1] - speeds[left]
    # Hermite's cubic, in Horner's form.
    bend = start * width + end * width - 2.0 * rise
    return speeds[left] + t * (start * width + t * (rise - start * width - bend + t * bend))


def _left(at: float, signals: Sequence[float]) -> int:
    left = 0
    while left < len(signals) - 2 and at > signals[left + 1]:
        left += 1
    return left


def _slope(place: int, signals: Sequence[float], speeds: Sequence[float]) -> float:
    last = len(signals) - 1
    if last == 1:
        return _secant(0, signals, speeds)
    if place == 0:
        return _end_slope(0, 1, signals, speeds)
    if place == last:
        return _end_slope(last - 1, last - 2, signals, speeds)
    before, after = _secant(place - 1, signals, speeds), _secant(place, signals, speeds)
    if before * after <= 0.0:
        return 0.0
    h_before = signals[place] - signals[place - 1]
    h_after = signals[place + 1] - signals[place]
    w_before, w_after = 2.0 * h_after + h_before, h_after + 2.0 * h_before
    return (w_before + w_after) / (w_before / before + w_after / after)


def _end_slope(outer: int, inner: int, signals: Sequence[float], speeds: Sequence[float]) -> float:
    h_outer = signals[outer + 1] - signals[outer]
    h_inner = signals[inner + 1] - signals[inner]
    d_outer, d_inner = _secant(outer, signals, speeds), _secant(inner, signals, speeds)
    slope = ((2.0 * h_outer + h_inner) * d_outer - h_outer * d_inner) / (h_outer + h_inner)
    if slope * d_outer <= 0.0:
        return 0.0
    if d_outer * d_inner <= 0.0 and abs(slope) > 3.0 * abs(d_outer):
        return 3.0 * d_outer
    return slope


def _secant(left: int, signals: Sequence[float], speeds: Sequence[float]) -> float:
    return (speeds[left + 1] - speeds[left]) / (signals[left + 1] - signals[left])


def is_signal(signal: float, full: float) -> bool:
    """Whether a number is a valve signal."""
    return math.isfinite(signal) and abs(signal) <= full
