"""Stick measures: how the operator used the sticks."""

from collections.abc import Mapping

import numpy as np

from labcrane.types import FloatArray


def stick_use(axes: Mapping[str, FloatArray], dead_zone: float) -> dict[str, float]:
    """Return how sticks were used: ``simultaneous``, ``axes_used`` and ``bimanual``.

    The number of axes is the measure of forestry's "functions used simultaneously" (Polowy &
    Rutkowski 2024, Forests 15:1277). ``bimanual`` is NaN when no stick was in use.

    Parameters
    ----------
    axes
        By name; what stands before the last dot is the stick: ``left.x``. Shape ``(n,)`` each.
    dead_zone
        Deflection beyond which an axis is in use, as a fraction of full scale.
    """
    used = {name: np.abs(values) > dead_zone for name, values in axes.items()}
    count = np.sum(list(used.values()), axis=0)
    sticks = {name.rpartition(".")[0] for name in used}
    hands = np.sum(
        [
            np.any([use for name, use in used.items() if name.rpartition(".")[0] == stick], axis=0)
            for stick in sticks
        ],
        axis=0,
    )
    any_use = int((hands > 0).sum())
    return {
        "simultaneous": float((count > 1).mean()),
        "axes_used": float(count.mean()),
        "bimanual": float((hands > 1).sum() / any_use) if any_use else float("nan"),
    }


def reversals(axis: FloatArray, hysteresis: float) -> int:
    """Return how often an axis changed its direction by more than ``hysteresis``.

    The stick's counterpart of steering reversals: turning points between which the axis moves by
    more than a fraction of full scale.
    """
    if float(axis.max() - axis.min()) <= hysteresis:
        return 0
    steps = np.diff(axis)
    moved = np.flatnonzero(steps)
    ways = np.sign(steps[moved])
    turns = moved[:-1][ways[:-1] != ways[1:]] + 1
    ends = np.concatenate([axis[:1], axis[turns], axis[-1:]])
    # A swing within the hysteresis and within both of its neighbours moves nothing that is counted:
    # all that there are go at once, until none is left.
    while True:
        swings = np.abs(np.diff(ends))
        least = swings <= hysteresis
        least[1:] &= swings[1:] < swings[:-1]  # of several alike the first
        least[:-1] &= swings[:-1] <= swings[1:]
        if not least.any():
            return len(swings) - 1
        gone = np.zeros(len(ends), bool)
        gone[:-1] |= least
        gone[1:] |= least
        # At an end the swing's own end goes, and the turning point stays.
        gone[1] &= not least[0] or len(least) == 1
        gone[-2] &= not least[-1] or len(least) == 1
        ends = ends[~gone]
        if len(ends) < 2:  # noqa: PLR2004 - no swing is left
            return 0


def coordination(
    left: FloatArray, right: FloatArray, rate_hz: float, most_s: float = 0.5
) -> tuple[float, float]:
    """Return the peak of the cross-correlation of two hands' deflections, and its lag in seconds.

    Lags are searched to ``most_s`` either way: the best of all lags of a movement is high for hands
    that have nothing to do with each other.

    Parameters
    ----------
    left, right
        Deflection, 0 or more, shape ``(n,)``.

    Returns
    -------
    tuple[float, float]
        Correlation, -1 to 1, and lag, positive when the right hand follows the left; NaN when one
        of them never moved.
    """
    from scipy.signal import correlate

    a, b = left - left.mean(), right - right.mean()
    power = float(np.sqrt((a @ a) * (b @ b)))
    if power == 0.0:
        return float("nan"), float("nan")
    lags = np.arange(1 - len(a), len(a))
    near = np.abs(lags) <= most_s * rate_hz
    values, lags = correlate(b, a)[near] / power, lags[near]
    peak = int(np.argmax(values))
    return float(values[peak]), float(lags[peak]) / rate_hz


def effort(command: FloatArray, speeds: FloatArray) -> float:
    """Return the root mean square of the commands over all joints, as a fraction of full speed.

    ``command`` is in rad/s, shape ``(n, n_joints)``; ``speeds`` has shape ``(n_joints,)``.
    """
    return float(np.sqrt(((command / speeds) ** 2).mean()))


def limit_hits(angles: FloatArray, limits: FloatArray, tolerance: float) -> int:
    """Return how often a joint came to one of its limits; a joint that starts there counts once.

    Parameters
    ----------
    angles
        In rad, shape ``(n, n_joints)``.
    limits
        Lowest and highest angle in rad, shape ``(n_joints, 2)``.
    tolerance
        Distance in rad at which a joint is at its limit.
    """
    at = (angles <= limits[:, 0] + tolerance) | (angles >= limits[:, 1] - tolerance)
    before = np.vstack([np.zeros((1, at.shape[1]), bool), at[:-1]])
    return int((at & ~before).sum())


def stick_rates(axis: FloatArray, rate_hz: float, window_s: float) -> FloatArray:
    """Return how fast an axis moves around each sample, in full scales per second, shape ``(n,)``.

    It is the change over a window, which is shorter at both ends. A rate from one sample to the
    next would grow with the sampling rate wherever the axis has steps.
    """
    if len(axis) < 2:  # noqa: PLR2004 - no change can be seen
        return np.full(len(axis), np.nan)
    times = np.arange(len(axis)) / rate_hz
    before = np.maximum(times - window_s / 2.0, 0.0)
    after = np.minimum(times + window_s / 2.0, times[-1])
    change = np.interp(after, times, axis) - np.interp(before, times, axis)
    rates: FloatArray = change / (after - before)
    return rates


def inceptor_use(
    axes: Mapping[str, FloatArray],
    rate_hz: float,
    *,
    window_s: float,
    least_rate: float,
    highest_hz: float,
) -> dict[str, float]:
    """Return how much the sticks were worked: duty cycle, aggressiveness, power and centroid.

    Duty cycle and aggressiveness are after those of pilot inceptor workload (Hanson et al. 2014,
    NASA/TM, Complexity and pilot workload metrics for the evaluation of adaptive flight controls
    on a full scale piloted aircraft), with the rate of :func:`stick_rates`. That report measures
    deflection and rate in its own units. The centroid is NaN where nothing moves, and power and
    centroid where the sampling rate is less than twice the highest frequency.

    Parameters
    ----------
    axes
        By name, shape ``(n,)`` each.
    window_s
        Of :func:`stick_rates`.
    least_rate
        Rate from which on an axis moves, in full scales per second.
    highest_hz
        Highest frequency that hands make.
    """
    values = np.array(list(axes.values()))
    rates = np.array([stick_rates(each, rate_hz, window_s) for each in values])
    power, centroid = _spectrum(values, rate_hz, highest_hz)
    return {
        "duty_cycle": float((np.abs(rates) > least_rate).any(axis=0).mean()),
        "aggressiveness": float(np.sqrt((rates**2).sum(axis=0).mean())),
        "stick_power": power,
        "stick_centroid": centroid,
    }


def _spectrum(values: FloatArray, rate_hz: float, highest_hz: float) -> tuple[float, float]:
    """Return power and mean frequency of a periodogram with a Hann window."""
    if rate_hz < 2.0 * highest_hz:
        return float("nan"), float("nan")
    count = values.shape[1]
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    mean = (values * window).sum(axis=1, keepdims=True) / window.sum()  # no leak from the mean
    spectrum = np.abs(np.fft.rfft((values - mean) * window, axis=1)) ** 2
    spectrum[:, 1 : (count + 1) // 2] *= 2.0
    power = spectrum.sum(axis=0) / (count * (window**2).sum())
    frequency = np.fft.rfftfreq(count, 1.0 / rate_hz)
    own = frequency <= highest_hz
    total = float(power[own].sum())
    return total, float(frequency[own] @ power[own]) / total if total > 0.0 else float("nan")


def resolution(axes: Mapping[str, FloatArray]) -> tuple[float, float]:
    """Return the smallest step and the smallest deflection of the axes; NaN where nothing moves.

    A step as large as a limit of the measures, or a dead zone that hides small deflections, decides
    them instead of the hands.
    """
    values = np.array(list(axes.values()))
    found = []
    for sizes in (np.abs(np.diff(values, axis=1)), np.abs(values)):
        moved = sizes[sizes > 0.0]
        found.append(float(moved.min()) if moved.size else float("nan"))
    return found[0], found[1]


STEP_S = 0.15
"""Time between the samples of steering entropy."""

BINS = np.array([-5.0, -2.5, -1.0, -0.5, 0.5, 1.0, 2.5, 5.0])
"""Edges of its nine bins, in 90th percentiles of the error."""

FEWEST_ERRORS = 10
"""A movement with fewer errors of prediction has no entropy."""


def prediction_errors(axis: FloatArray, rate_hz: float) -> FloatArray:
    """Return by how much an axis differs from its prediction, every 0.15 s.

    The prediction is a Taylor series of second order from the three samples before (Nakayama,
    Futami, Nakamura and Boer 1999, SAE 1999-01-0892).
    """
    times = np.arange(0.0, (len(axis) - 1) / rate_hz, STEP_S)
    a = np.interp(times, np.arange(len(axis)) / rate_hz, axis)
    if len(a) < 4:  # noqa: PLR2004 - three samples and the one that they predict
        return np.empty(0)
    speed = a[1:] - a[:-1]
    predicted = a[2:-1] + speed[1:-1] + 0.5 * (speed[1:-1] - speed[:-2])
    errors: FloatArray = a[3:] - predicted
    return errors


def steering_entropy(errors: FloatArray, usual: float) -> float:
    """Return the entropy of errors of prediction, 0 for predictable to 1.

    Boer's steering entropy of a stick (Nakayama et al. 1999; Boer 2000, Proceedings of the Human
    Factors and Ergonomics Society 44): nine bins, logarithm to base nine.

    Parameters
    ----------
    usual
        90th percentile of the absolute errors of the reference: here of all movements of the
        session. Entropies of two sessions cannot be compared if their references differ.
    """
    if len(errors) < FEWEST_ERRORS or not usual > 0.0:
        return float("nan")
    counts = np.bincount(np.searchsorted(BINS * usual, errors), minlength=len(BINS) + 1)
    shares = counts[counts > 0] / len(errors)
    return float(-(shares * np.log(shares)).sum() / np.log(len(BINS) + 1)) + 0.0
