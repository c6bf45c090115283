"""Drives of limited torque and rigid end stops, all joints together."""

from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray, PluginError

ROUNDING = 1e-12
"""In rad/s: speeds this near are the same."""

AT_LOWER, GIVES_ALL_UP, AT_SPEED, GIVES_ALL_DOWN, AT_UPPER = range(5)
"""What a joint does, in the order of its speed: it rests at a stop, its drive gives its maximum and
is too slow, it has the requested speed, or its drive gives its maximum against a faster motion."""

PASSES = 50
"""For every joint; a few for all of them are the rule."""


def limited_torques(
    mass: FloatArray,
    force: FloatArray,
    angles: Sequence[float],
    speeds: Sequence[float],
    asked: Sequence[float],
    efforts: Sequence[float],
    limits: Sequence[tuple[float, float]],
    dt: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the torques of drives that come as near to the speeds asked for as they can.

    A step is ``v += dt * inv(mass) @ (force + torques + pushes)``, then ``angle += dt * v``. A
    drive gives at most its effort, and all of it only where its joint is slower or faster than was
    asked for; an end stop pushes away from itself, and only when its joint would go through
    otherwise. That is the least of a convex function of the speeds, ``(v - free) K^-1 (v - free) /
    2 + sum(effort |v - asked|)`` between the stops, with ``K = dt inv(mass)``: so there is one
    solution. Joints are moved one by one, that which is furthest from its own condition first, to
    the next state in the order of their speeds (a box-constrained linear complementarity problem:
    Cottle, Pang and Stone 1992, chapter 4).

    Parameters
    ----------
    mass
        In kg m², shape ``(n, n)``; with what the step takes implicitly.
    force
        What acts on each coordinate otherwise, in N m, shape ``(n,)``.
    angles, speeds
        Before the step, in rad and rad/s; the first coordinates are those of the joints.
    asked
        Speed that each joint should have after it, in rad/s.
    efforts
        Largest torque of each drive, in N m.
    limits
        Lowest and highest angle of each joint, in rad. A joint that is beyond is let no further.

    Returns
    -------
    tuple
        Torques of the drives and pushes of the stops, in N m, both of shape ``(len(limits),)``.

    Raises
    ------
    PluginError
        The mass matrix is not positive, so that there is no solution.
    """
    joints = len(limits)
    inverse = np.linalg.inv(mass)
    free = (np.asarray(speeds) + dt * (inverse @ force))[:joints]
    inverse = dt * inverse[:joints, :joints]
    angle, effort = np.asarray(angles[:joints]), np.asarray(efforts)
    lowest, highest = np.asarray(limits).T
    slowest = np.minimum(lowest - angle, 0.0) / dt
    fastest = np.maximum(highest - angle, 0.0) / dt
    wanted = np.clip(asked, slowest, fastest)
    # Of every state, a row each: its speed and torque, and between which the other of both may be.
    nothing, endless = np.zeros(joints), np.full(joints, np.inf)
    pins = np.array([slowest, nothing, wanted, nothing, fastest])
    gives = np.array([nothing, effort, nothing, -effort, nothing])
    at_lower, at_upper = wanted <= slowest, wanted >= fastest
    down, up = np.where(at_upper, -endless, -effort), np.where(at_lower, endless, effort)
    least = np.array([effort, slowest, down, wanted, -endless])
    most = np.array([endless, wanted, up, fastest, -effort])
    stiff = np.diag(inverse)
    doing = np.full(joints, AT_SPEED)
    every = np.arange(joints)
    for _ in range(PASSES * joints):
        held = doing % 2 == 0
        torque = gives[doing, every]
        if held.any():
            gaps = pins[doing, every] - free - inverse @ torque
            torque[held] = np.linalg.solve(inverse[np.ix_(held, held)], gaps[held])
        speed = free + inverse @ torque
        shown = np.where(held, torque, speed)
        # A torque beyond its bounds is expressed as the speed that it causes, like the others.
        unit = np.where(held, stiff, 1.0)
        over = (shown - most[doing, every]) * unit
        under = (least[doing, every] - shown) * unit
        beyond = np.maximum(over, under)
        worst = int(beyond.argmax())
        if beyond[worst] <= ROUNDING:
            drives = np.clip(torque, -effort, effort)
            return drives, torque - drives
        # Too much torque, or too little speed: slower. The other way round: faster.
        slower = (over[worst] > under[worst]) == held[worst]
        doing[worst] += -1 if slower else 1
    raise PluginError("the drives' torques have no solution; a mass or an inertia is not positive")
