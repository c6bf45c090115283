"""Certificate of a stream's stamps in words: what they carry, what was done, what stays hidden."""

import numpy as np

from labcrane.streams.sync.quality import Quality

CARRIES = (
    (0.001, "single-trial ERP, averaged ERP, gaze, movement"),
    (0.004, "averaged ERP, gaze, movement; not single-trial ERP"),
    (0.010, "gaze, movement; no ERP"),
    (0.050, "movement; neither ERP nor gaze"),
)
"""Uncertainty at 95 % up to which stamps carry an analysis, in seconds: a quarter of the finest
feature, which for a single-trial latency is 4 ms and for a fixation 40 ms."""


def carries(quality: Quality) -> str:
    """Return which analyses the stamps carry, in words."""
    for limit, words in CARRIES:
        if quality.error_p95_s <= limit:
            return words
    return "the order of events at most: no ERP, no gaze, no movement"


def corrections(quality: Quality) -> list[str]:
    """Return what was done to the stamps, one sentence each."""
    done = []
    if np.isfinite(quality.drift_ppm):
        done.append(f"mapped from a clock that runs {quality.drift_ppm:+.1f} ppm off")
    for count, what in (
        (quality.steps, "steps of its clock"),
        (quality.restarts, "restarts of its program"),
        (quality.sleeps, "sleeps of its computer"),
        (quality.slews, "slews of a clock"),
    ):
        if count:
            done.append(f"{count} {what} followed")
    if quality.stalls:
        done.append(
            f"{quality.stalls} times samples came up to {quality.longest_stall_s:.1f} s late and "
            "kept their own times"
        )
    if quality.disordered:
        done.append(f"{quality.disordered} samples came out of order and kept their own times")
    if quality.moved_max_s > 0.0:
        done.append(
            f"evening moved 95 % of the samples by less than {1e3 * quality.moved_p95_s:.3f} ms, "
            f"the furthest by {1e3 * quality.moved_max_s:.3f} ms"
        )
    return done


def unknowable(quality: Quality) -> str:
    """Return what no software can know of the stamps."""
    if np.isnan(quality.hidden_s):
        return "without probes nothing bounds how far its clock is off"
    return (
        f"a lasting asymmetry of the network may hide {1e3 * quality.hidden_s:.3f} ms, half of the "
        "shortest round trip; what happens in the device before it stamps is its maker's to say"
    )
