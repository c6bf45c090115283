"""Smoothness of a movement."""

import numpy as np

from labcrane.types import FloatArray

PADDING = 4
"""The spectrum has 2 to this power times more points than the next power of 2."""


def sparc(
    speed: FloatArray,
    rate_hz: float,
    *,
    highest_hz: float = 10.0,
    least: float = 0.05,
) -> float:
    """Return the spectral arc length of a speed profile: 0 is smoothest, less is less smooth.

    The length of the speed's normalised amplitude spectrum, negated, up to the highest frequency
    at or below ``highest_hz`` at which it is at least ``least`` (Balasubramanian et al. 2015, J
    NeuroEng Rehabil 12:112; frequency is normalised by that range). For single movements; values
    with different ``highest_hz`` cannot be compared.

    Parameters
    ----------
    speed
        From onset to offset, in any unit, shape ``(n,)``.
    """
    points = 2 ** (int(np.ceil(np.log2(len(speed)))) + PADDING)
    frequency = np.arange(points) * (rate_hz / points)
    spectrum = np.abs(np.fft.fft(speed, points))
    spectrum /= spectrum.max()
    low = frequency <= highest_hz
    frequency, spectrum = frequency[low], spectrum[low]
    enough = np.flatnonzero(spectrum >= least)
    frequency = frequency[enough[0] : enough[-1] + 1]
    spectrum = spectrum[enough[0] : enough[-1] + 1]
    width = frequency[-1] - frequency[0]
    if width == 0.0:
        return float("nan")
    steps = np.hypot(np.diff(frequency) / width, np.diff(spectrum))
    return -float(steps.sum())


def ldlj(
    velocity: FloatArray, rate_hz: float, span: slice | None = None, *, low_pass_hz: float = 6.0
) -> float:
    """Return the log dimensionless jerk of a movement: higher is smoother.

    ``-ln(T³ / v_peak² · ∫ |d²v/dt²|² dt)`` of the velocity vector, so that a bend is jerk as well
    as a change of speed (Balasubramanian et al. 2015, J NeuroEng Rehabil 12:112). A minimum-jerk
    movement along a line has -ln(720 / 1.875²) = -5.32. Velocity is :func:`low_pass` filtered, and
    differentiated as a spline, so that the result is not one of the sampling rate; the noise of
    sensors within the pass-band is jerk too. It falls with duration where there are halts or
    several strokes: T³ is that of one.

    Parameters
    ----------
    velocity
        In any unit, shape ``(n, n_axes)``, four samples or more.
    span
        From onset to offset. What is before and behind lets the filter settle; without it, all.
    """
    from scipy.interpolate import make_interp_spline

    time = np.arange(len(velocity)) / rate_hz
    curve = make_interp_spline(time, low_pass(velocity, rate_hz, low_pass_hz), k=3)
    first, last = (0, len(time) - 1) if span is None else (span.start, span.stop - 1)
    fine = np.linspace(time[first], time[last], FINE * (last - first) + 1)
    jerk = (curve(fine, 2) ** 2).sum(axis=1)
    peak = float(np.linalg.norm(curve(fine), axis=1).max())
    scale = (time[last] - time[first]) ** 3 / peak**2
    return -float(np.log(scale * np.trapezoid(jerk, fine)))


FINE = 8
"""Points of a spline between two samples, at which its square is summed."""


def sub_movements(
    speed: FloatArray, rate_hz: float, *, low_pass_hz: float = 6.0, prominence: float = 0.05
) -> int:
    """Return how many peaks the speed has, after :func:`low_pass`.

    A peak rises by at least ``prominence`` of the largest speed above what separates it from a
    higher one.
    """
    from scipy.signal import find_peaks

    # A movement that ends fast still has a peak.
    smooth = low_pass(np.concatenate([[0.0], speed, [0.0]]), rate_hz, low_pass_hz)
    peaks, _ = find_peaks(smooth, prominence=prominence * float(smooth.max()))
    return len(peaks)


def low_pass(values: FloatArray, rate_hz: float, cutoff_hz: float) -> FloatArray:
    """Return values low-pass filtered, without delay.

    The gain of a Butterworth filter of second order run forwards and backwards, with -3 dB of both
    together at ``cutoff_hz``: ``1 / (1 + (√2 - 1) (f / cutoff)⁴)``. It is applied to the sine
    transform of what is beside the line from the first to the last sample, which stay as they are;
    so, other than with a digital filter, no frequency's gain is one of the sampling rate.

    Parameters
    ----------
    values
        Shape ``(n,)`` or ``(n, n_axes)``.
    rate_hz, cutoff_hz
        In Hz.

    Raises
    ------
    ValueError
        The cutoff is not below half of the rate.
    """
    from scipy.fft import dst, idst

    if not 0.0 < cutoff_hz < rate_hz / 2.0:
        raise ValueError(
            f"a low-pass at {cutoff_hz:g} Hz needs more than {2.0 * cutoff_hz:g} samples a second, "
            f"and there are {rate_hz:g}; lower the cutoff"
        )
    inner = len(values) - 2
    if inner < 1:
        return values
    line = np.linspace(values[0], values[-1], len(values))
    frequency = np.arange(1, inner + 1) * rate_hz / (2.0 * (inner + 1))
    gain = 1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * (frequency / cutoff_hz) ** 4)
    waves = dst((values - line)[1:-1], type=1, axis=0)
    smooth: FloatArray = line.copy()
    smooth[1:-1] += idst(gain.reshape(-1, *[1] * (values.ndim - 1)) * waves, type=1, axis=0)
    return smooth


def path_ratio(tip: FloatArray) -> float:
    """Return the path length divided by the straight distance between its ends, 1 or more.

    ``tip`` is in metres, shape ``(n, 3)``. NaN for a path that ends where it began.
    """
    straight = float(np.linalg.norm(tip[-1] - tip[0]))
    length = float(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum())
    return length / straight if straight > 0.0 else float("nan")
