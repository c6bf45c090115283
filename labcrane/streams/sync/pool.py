"""Pool of clock probes: streams of one computer share its clock, and each one measures it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from labcrane.streams.sync.epochs import in_order
from labcrane.streams.sync.raw import LOCAL, OFFSET, REMOTE, RTT, RawStream
from labcrane.types import FloatArray

SAME_S = 5e-4
"""Offsets that differ by less than this, and what round trips hide, are of one clock."""


def pooled(streams: Sequence[RawStream], hosts: Sequence[str]) -> list[RawStream]:
    """Return the streams with all probes of their computer's clock.

    Two devices on one computer are then mapped by one curve, and agree with each other whatever the
    network does. That they share a clock is seen in their probes: a program in a container, or
    under a debugger of clocks, may have one of its own.

    Parameters
    ----------
    streams
        As received.
    hosts
        The computer of each; empty where it is not known.
    """
    ordered = [in_order(stream.probes) for stream in streams]
    result = []
    for k, (stream, host) in enumerate(zip(streams, hosts, strict=True)):
        others = [
            j
            for j in range(len(streams))
            if j != k and host and hosts[j] == host and _is_one_clock(ordered[k], ordered[j])
        ]
        if not others:
            result.append(stream)
            continue
        together = np.concatenate([ordered[j] for j in (k, *others)])
        together = together[np.argsort(together[:, LOCAL], kind="stable")]
        result.append(replace(stream, probes=together, own_probes=ordered[k]))
    return result


def _is_one_clock(one: FloatArray, other: FloatArray) -> bool:
    """Whether offsets told at the same times are the same."""
    if len(one) < 2 or len(other) < 2:  # noqa: PLR2004
        return False
    at = one[:, LOCAL]
    inside = (at >= other[0, LOCAL]) & (at <= other[-1, LOCAL])
    if not inside.any():
        return False
    apart = np.abs(one[inside, OFFSET] - np.interp(at[inside], other[:, LOCAL], other[:, OFFSET]))
    after = np.clip(np.searchsorted(other[:, LOCAL], at[inside]), 1, len(other) - 1)
    held_up = np.maximum(other[after, RTT], other[after - 1, RTT])
    apart -= (one[inside, RTT] + held_up) / 2.0
    near = np.abs(one[inside, REMOTE] - np.interp(at[inside], other[:, LOCAL], other[:, REMOTE]))
    return bool(np.quantile(apart, 0.9) < SAME_S and np.median(near) < 10.0)  # noqa: PLR2004
