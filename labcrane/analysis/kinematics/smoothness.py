"""Smoothness of a movement."""

from functools import cache

import numpy as np

from labcrane.types import FloatArray


def sparc(
    speed: FloatArray,
    rate_hz: float,
    *,
    highest_hz: float = 10.0,
    least: float = 0.05,
    padding: int = 4,
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
    padding
        The spectrum has 2 to the power of ``padding`` times more points than the next power of 2.
    """
    points = 2 ** (int(np.ceil(np.log2(len(speed)))) + padding)
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


def ldlj(speed: FloatArray, rate_hz: float) -> float:
    """Return the log dimensionless jerk of a speed profile: higher is smoother.

    ``-ln(T³ / v_peak² · ∫ (d²v/dt²)² dt)`` with the second difference for the derivative
    (Balasubramanian et al. 2015). A minimum-jerk movement has -ln(720 / 1.875²) = -5.32.

    Parameters
    ----------
    speed
        From onset to offset, in any unit, shape ``(n,)``, three samples or more.
    """
    dt = 1.0 / rate_hz
    jerk = np.diff(speed, 2) / dt**2
    scale = (len(speed) * dt) ** 3 / float(np.abs(speed).max()) ** 2
    return -float(np.log(scale * (jerk**2).sum() * dt))


def sub_movements(
    speed: FloatArray, rate_hz: float, *, low_pass_hz: float = 6.0, prominence: float = 0.05
) -> int:
    """Return how many peaks the speed has.

    Counted after a second-order Butterworth low-pass run forwards and backwards. A peak rises by
    at least ``prominence`` of the largest speed above what separates it from a higher one.
    """
    from scipy.signal import find_peaks, sosfiltfilt

    sections = _low_pass(low_pass_hz, rate_hz)
    padded = np.concatenate([[0.0], speed, [0.0]])  # a movement that ends fast still has a peak
    smooth = sosfiltfilt(sections, padded, padlen=min(int(rate_hz), len(padded) - 1))
    peaks, _ = find_peaks(smooth, prominence=prominence * float(smooth.max()))
    return len(peaks)


@cache
def _low_pass(low_pass_hz: float, rate_hz: float) -> FloatArray:
    """Return the sections of a filter, which takes longer to work out than to use."""
    from scipy.signal import butter

    return np.asarray(butter(2, low_pass_hz, fs=rate_hz, output="sos"))


def path_ratio(tip: FloatArray) -> float:
    """Return the length of the way over the straight distance between its ends, 1 or more.

    ``tip`` is in metres, shape ``(n, 3)``. NaN for a way that ends where it began.
    """
    straight = float(np.linalg.norm(tip[-1] - tip[0]))
    length = float(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum())
    return length / straight if straight > 0.0 else float("nan")
