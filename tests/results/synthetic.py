"""Movements of 36 made-up participants in the design of the aiming study. No data of people."""

import math

import numpy as np
import pandas as pd

PAIRS = [(distance, side) for distance in (2.0, 3.0, 4.0, 6.0) for side in ("left", "right")]


def cohort_of_36(seed: int = 7) -> pd.DataFrame:
    """Return 36 participants × 8 pairs in a random order each × 4 movements.

    Movement time is log-normal about Fitts' law, with a pace of each participant and a learning
    that differs between them, so that variances grow and sphericity does not hold.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for person in range(1, 37):
        pace, learning = rng.normal(0.0, 0.2), rng.normal(-0.04, 0.04)
        for sequence, at in enumerate(rng.permutation(8), start=1):
            distance, side = PAIRS[at]
            bits = math.log2(distance / 0.5 + 1.0)
            for movement in range(4):
                noise = rng.normal(0.0, 0.15)
                time = (1.0 + 2.5 * bits) * math.exp(pace + learning * sequence + noise)
                along = rng.normal(0.01, 0.05)
                rows.append(
                    {
                        "participant": f"P{person:03}",
                        "sequence": sequence,
                        "trial": 4 * (sequence - 1) + movement + 1,
                        "distance": distance,
                        "difficulty": bits,
                        "far_side": side,
                        "movement_time": time,
                        "absolute_error": abs(along) + abs(rng.normal(0.0, 0.03)),
                        "error_along": along,
                        "amplitude": distance + along,
                    }
                )
    return pd.DataFrame(rows)
