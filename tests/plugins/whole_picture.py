"""What must be in every whole picture of the crane in its forest: so many pixels of each colour."""

import numpy as np


def counted(picture: np.ndarray) -> dict[str, int]:
    """Return how many pixels have the colour of sky, ground, crane, target and text."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    height = len(picture)
    corner = np.zeros(red.shape, bool)
    corner[: height // 5, : picture.shape[1] // 3] = True
    bright = (red > 150) & (green > 150) & (blue > 150)
    return {
        "lower half": int((picture[height // 2 :].max(axis=-1) > 0).sum()),
        "ground": int(((green > red) & (green > blue + 15))[height // 2 :].sum()),
        "crane": int(((red > 1.25 * green) & (green > 1.6 * blue) & (red > 60)).sum()),
        "text": int((bright & corner).sum()),
        "sky": int((bright & ~corner)[: height // 2].sum()),
    }
