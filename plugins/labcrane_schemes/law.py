"""Block of numbers with which a compiled scheme works; :mod:`.compiled` says what lies where."""

import numpy as np

from labcrane import FloatArray, Machine
from labcrane_schemes.axis_map import Axis
from labcrane_schemes.resolved_rate import ResolvedRate
from labcrane_schemes.shaping import Shaping
from labcrane_schemes.soft_stops import SoftStops


def law(
    machine: Machine,
    sticks: tuple[Axis, ...],
    shaping: Shaping,
    stops: SoftStops,
    rate: ResolvedRate,
    full: tuple[float, ...],
    tip: tuple[float, bool] | None = None,
) -> FloatArray:
    """Return the block of one scheme.

    Parameters
    ----------
    sticks
        Which axis moves what, and by how much.
    full
        The joints' largest speeds in rad/s.
    tip
        For a scheme that moves the tip: its speed in m/s, and whether along the base frame.
    """
    from labcrane_schemes.compiled import N_TABLES, TABLES  # noqa: PLC0415 - loads numba

    joints = len(machine.joints)
    stride = max(joints, len(sticks))
    speed, base = tip or (0.0, False)
    head = (
        float(tip is not None), joints, len(sticks), *shaping.numbers, stops.width,
        *rate.numbers, speed, float(base), stride,
    )  # fmt: skip
    tables = np.zeros((N_TABLES, stride))
    tables[0, : len(sticks)] = [axis for axis, _ in sticks]
    tables[1, : len(sticks)] = [factor for _, factor in sticks]
    tables[2, :joints], tables[3, :joints] = np.transpose(machine.limits)
    tables[4, :joints] = [joint.a for joint in machine.joints]
    tables[5, :joints] = [joint.offset for joint in machine.joints]
    tables[6, :joints] = full
    assert len(head) == TABLES  # noqa: S101 - the two modules belong together
    return np.concatenate([head, tables.ravel()])


def kernel_numbers(first: FloatArray, second: FloatArray | None = None) -> FloatArray:
    """Return what the kernel of a scheme knows: of one law, or of two and a button."""
    from labcrane_schemes.compiled import FIRST, HEAD, SECOND  # noqa: PLC0415 - loads numba

    head = np.zeros(HEAD)
    head[FIRST], head[SECOND] = HEAD, HEAD + len(first)
    return np.concatenate([head, first] if second is None else [head, first, second])
