"""Rotations as matrices."""

from collections.abc import Iterable

import numpy as np

from labcrane.types import FloatArray


def rotation_matrix(quaternion: Iterable[float]) -> FloatArray:
    """Return the rotation of a unit quaternion x, y, z, w, shape ``(3, 3)``.

    The numbers have no unit and are in [-1, 1]. Other quaternions give a matrix too, without an
    error: a state may contain them for a moment.
    """
    x, y, z, w = map(float, quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
