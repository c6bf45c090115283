"""Confounding: whether the effects of factors can be distinguished."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd


def dummies(labels: "np.typing.NDArray[np.integer[Any]]") -> FloatArray:
    """Return a column for each label, with 1 in its rows."""
    own: FloatArray = np.eye(int(labels.max(initial=-1)) + 1)[labels]
    return own


def told_apart(
    table: "pd.DataFrame", factor: Sequence[str], beside: Sequence[Sequence[str]]
) -> bool:
    """Return whether all differences of a factor's levels can be distinguished from other effects.

    The criterion is the rank: each level except one adds a dimension to a linear model of the
    others. It does not measure the precision.

    Parameters
    ----------
    table
        One row per movement.
    factor
        Its columns; a level is a combination of their values.
    beside
        The same for each of the others.
    """
    names = list(dict.fromkeys([*factor, *(name for other in beside for name in other)]))
    rows = table[names].drop_duplicates()
    others = np.hstack([dummies(rows.groupby(list(own)).ngroup().to_numpy()) for own in beside])
    levels = dummies(rows.groupby(list(factor)).ngroup().to_numpy())
    added = _rank(np.hstack([levels, others])) - _rank(others)
    return bool(added == levels.shape[1] - 1)


def _rank(columns: FloatArray) -> int:
    """Return the rank by the columns' products: rows are many, and columns few."""
    return int(np.linalg.matrix_rank(columns.T @ columns, hermitian=True))
