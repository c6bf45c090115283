"""A least-squares polynomial whose degree is chosen by cross-validation."""

from dataclasses import dataclass

import numpy as np

from labcrane import FloatArray
from labcrane_dmd.fit.speeds import SpeedCurve

FOLDS = 8
BLOCK = 3
"""Neighbouring points left out together: the sliding window makes them alike."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Coefficients of 1, x, x², ..., with x from -1 to 1 over the curve, and the residual's RMS."""

    coefficients: tuple[float, ...]
    residual: float


def fit(curve: SpeedCurve, max_degree: int) -> Fit:
    """Fit a speed curve, with the lowest degree that predicts as well as the best one.

    As well is within one standard error of its squared error on points that were left out.
    """
    lowest, highest = curve.covers
    x = (2.0 * curve.angle - lowest - highest) / (highest - lowest)
    degree = _degree(x, curve.speed, min(max_degree, len(x) // 4))
    coefficients = _solve(x, curve.speed, degree)
    left = curve.speed - np.polynomial.polynomial.polyval(x, coefficients)
    # Twelve digits: what follows is rounding, and differs between machines.
    rounded = tuple(float(f"{value:.12g}") for value in coefficients)
    return Fit(rounded, float(f"{np.sqrt(np.mean(left**2)):.6g}"))


def _degree(x: FloatArray, speed: FloatArray, most: int) -> int:
    folds = np.arange(len(x)) // BLOCK % FOLDS
    # The ends are always kept: a polynomial that has not seen them is extrapolated there.
    folds[0] = folds[-1] = -1
    errors = []
    for degree in range(1, most + 1):
        missed = [
            (
                speed[out]
                - np.polynomial.polynomial.polyval(x[out], _solve(x[~out], speed[~out], degree))
            )
            ** 2
            for out in (folds == fold for fold in range(FOLDS))
            if out.any()
        ]
        errors.append(np.concatenate(missed))
    if not errors:
        return 0
    means = np.array([error.mean() for error in errors])
    best = int(means.argmin())
    slack = float(errors[best].std() / np.sqrt(len(errors[best])))
    return 1 + int((means <= means[best] + slack).argmax())


def _solve(x: FloatArray, speed: FloatArray, degree: int) -> FloatArray:
    # Chebyshev polynomials are nearly orthogonal on evenly spread points; powers are not.
    found = np.polynomial.chebyshev.chebfit(x, speed, degree)
    return np.asarray(np.polynomial.chebyshev.cheb2poly(found))
