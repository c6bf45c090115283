"""End stops of joints: rigid, as a cylinder at its end is, whatever the drive does."""

from collections.abc import Sequence

import numpy as np

from labcrane import FloatArray

ROUNDING = 1e-12
"""In rad/s: less than this is no way through a stop."""


def stop_forces(
    mass: FloatArray,
    force: FloatArray,
    angles: Sequence[float],
    speeds: Sequence[float],
    limits: Sequence[tuple[float, float]],
    dt: float,
) -> FloatArray:
    """Return what the end stops push with, so that no joint goes through its own in a step.

    A step is ``v += dt * inv(mass) @ (force + pushes)``, then ``angle += dt * v``. A stop can push
    away from itself only, and only when its joint would go through otherwise, which is a linear
    complementarity problem: joints are held one by one, the fastest first, and let go when their
    stop would have to pull (Cottle, Pang and Stone 1992, chapter 4).

    Parameters
    ----------
    mass
        In kg m², shape ``(n, n)``; with what the step takes implicitly.
    force
        What acts on each coordinate otherwise, in N m, shape ``(n,)``.
    angles, speeds
        Before the step, in rad and rad/s; the first coordinates are those of the joints.
    limits
        Lowest and highest angle of each joint, in rad. A joint that is beyond is let no further.

    Returns
    -------
    FloatArray
        In N m, shape ``(len(limits),)``.
    """
    joints = len(limits)
    inverse = np.linalg.inv(mass)
    free = (np.asarray(speeds) + dt * (inverse @ force))[:joints]
    inverse = dt * inverse[:joints, :joints]
    angle = np.asarray(angles[:joints])
    lowest, highest = np.asarray(limits).T
    slowest = np.minimum(lowest - angle, 0.0) / dt
    fastest = np.maximum(highest - angle, 0.0) / dt
    push = np.zeros(joints)
    held: dict[int, float] = {}
    for _ in range(4 * joints):
        if held:
            at = list(held)
            gaps = np.array(list(held.values())) - free[at]
            push[:] = 0.0
            push[at] = np.linalg.solve(inverse[np.ix_(at, at)], gaps)
            # A lower stop pushes up, an upper one down.
            pulls = {j: push[j] * (-1.0 if held[j] == slowest[j] else 1.0) for j in at}
            worst = max(pulls, key=lambda joint: pulls[joint])
            if pulls[worst] > 0.0:
                del held[worst]
                push[worst] = 0.0
                continue
        speed = free + inverse @ push
        beyond = np.maximum(speed - fastest, slowest - speed)
        first = int(beyond.argmax())
        if beyond[first] <= ROUNDING:
            break
        held[first] = float(fastest[first] if speed[first] > fastest[first] else slowest[first])
    return push
