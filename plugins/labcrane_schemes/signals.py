"""Signals that every scheme logs each tick in addition to its command."""

import numpy as np

from labcrane import FloatArray, Machine, Signal


def scheme_signals(machine: Machine) -> tuple[Signal, ...]:
    """Return the signals of a scheme.

    ``scheme.scale`` is the factor that slowed all joints together to keep them within their
    speeds, ``scheme.limited`` what the soft stops left of each joint's speed: 1 is free.
    """
    return (
        Signal("command", "rad/s", machine.names),
        Signal("scheme.scale", "1"),
        Signal("scheme.limited", "1", machine.names),
    )


def rest(machine: Machine) -> FloatArray:
    """Return what a scheme logs while the machine is held still, shape ``(2 n_joints + 1,)``."""
    joints = len(machine.names)
    return np.concatenate([np.zeros(joints), np.ones(joints + 1)])
