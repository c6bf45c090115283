"""Rounding: differences caused by it alone, which are not tested."""

import numpy as np

from labcrane.types import FloatArray

ROUNDING = 1e-10
"""Share of the largest number; a smaller difference is due to rounding."""


def alike(values: FloatArray) -> bool:
    """Return whether all values are equal, but for rounding."""
    return bool(np.ptp(values) <= ROUNDING * np.abs(values).max())


def without_rounding(differences: FloatArray, of: FloatArray) -> FloatArray:
    """Return differences of values, with 0 where they are due to rounding.

    Parameters
    ----------
    differences
        Any differences, slopes or means of differences.
    of
        The values of the differences, which give the scale.
    """
    return np.where(np.abs(differences) <= ROUNDING * np.abs(of).max(initial=0.0), 0.0, differences)
