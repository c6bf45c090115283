"""Law of a scheme: from pushes to joint speeds and back, in scalars.

Everything a law knows lies in one block of numbers. The functions run as they are on a list, and
compiled on an array.

The slew turns the arm's plane and the pitch joints move within it, so the three directions radial,
tangential and vertical separate into one number for the slew and a least-squares problem for the
pitch joints. Its damping grows from 0 at the threshold to its largest value at a singularity
(Nakamura and Hanafusa 1986). Far from both limits and singularities, all joints are slowed by one
scale, which keeps the tip's direction.

Elsewhere the joints have bounds, which shrink to 0 at a limit. A joint at its bound stays there and
the others make the rest of the movement as well as they can: the tip's velocity is the possible one
nearest to what is asked for. Such a velocity is continuous in stick and pose, so that no tick
leaps; and it is 0 only if no possible movement has a part along the one that is asked for, so that
none freezes. One scale there would follow the joint that has the least left, and do both.
"""

import math
from collections.abc import Sequence
from math import cbrt

import numpy as np

from labcrane import FloatArray, Machine
from labcrane.core import Kernel, Places, compiled, kernel
from labcrane_schemes.axis_map import Axis
from labcrane_schemes.settings import EndEffectorSettings, HandlingSettings

Numbers = list[float] | FloatArray
"""A block, angles, axes or a command: a list in Python, an array in compiled code."""

(
    RESOLVED, JOINTS, EDGE, REST, LINEAR, EXPO, STRETCH, STEEPNESS, STRAIGHT, WIDTH, DAMPING2,
    THRESHOLD2, SPEED, BASE, STRIDE, TABLES,
) = range(16)  # fmt: skip
"""Layout of a block: whether it is resolved rate, then its numbers, then its tables."""
(
    AXIS, FACTOR, LOW, HIGH, LENGTH, OFFSET, FULL, COLUMN_R, COLUMN_Z, SPEEDS, FACTORS, LEAST, MOST,
    WANTED, BOUND,
) = range(15)  # fmt: skip
"""Tables, one row of numbers per joint or stick each. Those from COLUMN_R on are of one tick:
Jacobian, speeds in rad/s, what the soft stops leave of them, bounds of the speeds, speeds that
are wanted if those at a bound stay there, and 1 or -1 for a joint at its upper or lower bound."""
N_TABLES = 15
NOTHING = 1e-12
"""Joint speed in rad/s that is rounding, not motion."""
ROUNDING = 1e-16
"""Cubic weight that is lost in rounding, and whose root would overflow."""
FLOOR2 = 1e-3
"""Square of the least damping where joints have bounds, in m²: those left may be too few."""
CALM = 2.0
"""Squared damping at a limit, over that at a singularity: with less, a joint that makes up for the
one that stands still swings to and fro from tick to tick, at 60 Hz on a large machine."""
ASTRAY = 2.0
"""How much dearer than too little speed is speed across the direction that is asked for. A larger
weight makes the tip slower where it cannot keep the direction, and its speed change faster."""
PASSES = 4
"""Joints taken to a bound or from one, per joint of the machine; more would be a cycle."""


ACTIVE, DOWN, SHARE, SWITCHES, BUTTON, BUTTON_SIGN, FIRST, SECOND, STEP = range(9)
"""Head of a kernel's numbers, before one block or two: which law is active, whether the button is
down, the second law's share of the command, whether there is a button and where; where the blocks
begin, and by how much the share changes in a tick."""
CHANGING = 3
HEAD = 9


def block(
    machine: Machine, settings: HandlingSettings, full: Sequence[float], tip: str = ""
) -> list[float]:
    """Return the block of one scheme; its sticks follow when they are known.

    Parameters
    ----------
    full
        The joints' largest speeds in rad/s.
    tip
        For a scheme that moves the tip: ``base`` or ``arm``, whose directions its axes have.
    """
    joints, expo, linear = len(machine.joints), settings.expo, 1.0 - settings.expo
    cubic = expo >= ROUNDING and linear > 0.0
    stretch = 2.0 * math.sqrt(linear / (3.0 * expo)) if cubic else 0.0
    tipped = settings if isinstance(settings, EndEffectorSettings) else None
    damping, threshold = (tipped.damping, tipped.threshold_m) if tipped else (0.2, 0.5)
    stride = max(joints, 3)
    head = (
        bool(tip), joints, settings.dead_zone, 1.0 - settings.dead_zone,
        linear, expo, stretch, 3.0 / (linear * stretch) if cubic else 0.0, expo < ROUNDING,
        max(math.radians(settings.soft_stop_deg), 1e-9),  # a wall, not a division by zero
        damping * damping, threshold * threshold, 0.0, tip == "base", stride,
    )  # fmt: skip
    tables = np.zeros((N_TABLES, stride))
    tables[LOW, :joints], tables[HIGH, :joints] = np.transpose(machine.limits)
    tables[LENGTH, :joints] = [joint.a for joint in machine.joints]
    tables[OFFSET, :joints] = [joint.offset for joint in machine.joints]
    tables[FULL, :joints] = full
    return [*map(float, head), *tables.ravel().tolist()]


def put_sticks(own: list[float], axes: Sequence[Axis], full: Sequence[float]) -> None:
    """Put down which axis moves what, and by how much, in a block."""
    for number, ((axis, sign), most) in enumerate(zip(axes, full, strict=True)):
        own[table(own, 0, AXIS) + number] = float(axis)
        own[table(own, 0, FACTOR) + number] = sign * most


def kernel_of(first: list[float], second: Sequence[float] = ()) -> Kernel:
    """Return the kernel of a scheme: of one law, or of two and a button."""
    head = [0.0] * HEAD
    head[FIRST], head[SECOND] = HEAD, HEAD + len(first)
    numbers = np.array([*head, *first, *second])
    return Kernel(compiled.tick(tick), numbers, changing=0, inverse=compiled.inverse(inverse))


def table(own: Numbers, at: int, which: int) -> int:
    """Return where a table begins."""
    return at + TABLES + which * int(own[at + STRIDE])


def shape(own: Numbers, at: int, push: float) -> float:
    """Return the share of full speed, in [-1, 1], that a deflection in [-1, 1] asks for."""
    beyond = abs(push) - own[at + EDGE]
    if beyond <= 0.0:
        return 0.0
    x = beyond / own[at + REST]
    return math.copysign(x * (own[at + LINEAR] + own[at + EXPO] * x * x), push)


def unshape(own: Numbers, at: int, share: float) -> float:
    """Return the deflection that asks for a share of full speed, both in [-1, 1]."""
    if share == 0.0:
        return 0.0
    size = abs(share)
    x = size if size < 1.0 else 1.0
    if own[at + STRETCH] > 0.0:  # the one real root, after Cardano in its hyperbolic form
        x = own[at + STRETCH] * math.sinh(math.asinh(own[at + STEEPNESS] * x) / 3.0)
    elif own[at + STRAIGHT] == 0.0:
        x = cbrt(x)
    push = own[at + EDGE] + own[at + REST] * x
    return math.copysign(push if push < 1.0 else 1.0, share)


def left(room: float, width: float) -> float:
    """Return what a soft stop leaves of a joint's speed this far from the limit ahead."""
    if room >= width:
        return 1.0
    return room / width if room > 0.0 else 0.0


def free(own: Numbers, at: int, angles: Numbers) -> bool:
    """Say whether every joint is far from its limits, so that nothing is lost."""
    base, step = at + TABLES, int(own[at + STRIDE])
    low, high, width = base + LOW * step, base + HIGH * step, own[at + WIDTH]
    for j in range(int(own[at + JOINTS])):
        if not own[low + j] + width < angles[j] < own[high + j] - width:
            return False
    return True


def put_factors(own: Numbers, at: int, angles: Numbers) -> None:
    """Fill what is left of each joint's speed; leaving a limit is free."""
    base, step = at + TABLES, int(own[at + STRIDE])
    low, high, width = base + LOW * step, base + HIGH * step, own[at + WIDTH]
    speeds, factors = base + SPEEDS * step, base + FACTORS * step
    for j in range(int(own[at + JOINTS])):
        factor, speed = 1.0, own[speeds + j]
        if speed > 0.0:
            factor = left(own[high + j] - angles[j], width)
        elif speed < 0.0:
            factor = left(angles[j] - own[low + j], width)
        own[factors + j] = factor


def damp(own: Numbers, at: int, singular2: float) -> float:
    """Return the square of the damping, in m², for the square of a singular value."""
    if singular2 >= own[at + THRESHOLD2]:
        return 0.0
    return own[at + DAMPING2] * (1.0 - singular2 / own[at + THRESHOLD2])


def put_columns(own: Numbers, at: int, angles: Numbers) -> None:
    """Fill radius and height per speed of each pitch joint, in m/rad."""
    base, step = at + TABLES, int(own[at + STRIDE])
    n, length, offset = int(own[at + JOINTS]), base + LENGTH * step, base + OFFSET * step
    column_r, column_z = base + COLUMN_R * step, base + COLUMN_Z * step
    pitch = radius = drop = 0.0
    for j in range(1, n):
        pitch += angles[j] + own[offset + j]
        own[column_r + j] = pitch
    for j in range(n - 1, 0, -1):  # a joint moves all links behind it
        pitch = own[column_r + j]
        radius += own[length + j] * math.cos(pitch)
        drop += own[length + j] * math.sin(pitch)
        own[column_r + j], own[column_z + j] = -drop, -radius


def damping(own: Numbers, at: int, rr: float, rz: float, zz: float) -> float:
    """Return the square of the damping, in m², for ``J Jᵀ``."""
    threshold2 = own[at + THRESHOLD2]
    # This test for an eigenvalue below the threshold needs no square root; it rarely holds.
    if rr >= threshold2 and (rr - threshold2) * (zz - threshold2) > rz * rz:
        return 0.0
    # A root of squares, not hypot: that rounds otherwise since Python 3.12.
    apart, twice = rr - zz, 2.0 * rz
    largest = 0.5 * (rr + zz + math.sqrt(apart * apart + twice * twice))
    return damp(own, at, max(rr * zz - rz * rz, 0.0) / largest if largest > 0.0 else 0.0)


def weighted(own: Numbers, at: int, angles: Numbers) -> float:
    """Return the square of the damping, in m², where joints near a limit do not count in full.

    They count by the cube of what is left of their speed, so that no tick changes it by much.
    """
    base, step = at + TABLES, int(own[at + STRIDE])
    low, high, width = base + LOW * step, base + HIGH * step, own[at + WIDTH]
    r, z, n = base + COLUMN_R * step, base + COLUMN_Z * step, int(own[at + JOINTS])
    rr = rz = zz = 0.0
    for j in range(1, n):
        near = left(min(angles[j] - own[low + j], own[high + j] - angles[j]), width)
        weight = near * near * near  # a power is not of the same bits when it is compiled
        a, b = own[r + j], own[z + j]
        rr += weight * a * a
        rz += weight * a * b
        zz += weight * b * b
    return damping(own, at, rr, rz, zz)


def least_damping(own: Numbers, at: int, angles: Numbers) -> float:
    """Return the square of the least damping, in m², where joints have bounds."""
    base, step = at + TABLES, int(own[at + STRIDE])
    low, high, remains = base + LOW * step, base + HIGH * step, 1.0
    for j in range(1, int(own[at + JOINTS])):
        room = min(angles[j] - own[low + j], own[high + j] - angles[j])
        remains = min(remains, left(room, own[at + WIDTH]))
    return max(FLOOR2, CALM * own[at + DAMPING2] * (1.0 - remains))


def least_squares(own: Numbers, at: int, damping2: float, radial: float, vertical: float) -> float:
    """Fill the speeds that pitch joints want, those at a bound too, where these stay there.

    Return the square of the damping, in m²; it is computed where below 0 is given.

    It is ``Jᵀ (J Jᵀ + λ² I)⁻¹ v``.
    """
    base, step = at + TABLES, int(own[at + STRIDE])
    r, z, speeds = base + COLUMN_R * step, base + COLUMN_Z * step, base + SPEEDS * step
    wanted, bound, n = base + WANTED * step, base + BOUND * step, int(own[at + JOINTS])
    rr = rz = zz = 0.0
    for j in range(1, n):
        a, b = own[r + j], own[z + j]
        if own[bound + j] != 0.0:
            radial -= a * own[speeds + j]
            vertical -= b * own[speeds + j]
        else:
            rr += a * a
            rz += a * b
            zz += b * b
    if damping2 < 0.0:
        damping2 = damping(own, at, rr, rz, zz)
    rr += damping2
    zz += damping2
    det = rr * zz - rz * rz
    y_r = (zz * radial - rz * vertical) / det
    y_z = (rr * vertical - rz * radial) / det
    for j in range(1, n):
        own[wanted + j] = own[r + j] * y_r + own[z + j] * y_z
    return damping2


def bounded(own: Numbers, at: int, damping2: float, radial: float, vertical: float) -> None:
    """Fill the pitch joints' speeds that solve the least squares within their bounds.

    Active sets: from rest towards what the joints want, as far as the first bound; a joint is let
    go of where it wants to leave its bound.
    """
    base, step = at + TABLES, int(own[at + STRIDE])
    speeds, wanted, bound = base + SPEEDS * step, base + WANTED * step, base + BOUND * step
    least, most, n = base + LEAST * step, base + MOST * step, int(own[at + JOINTS])
    for j in range(1, n):
        own[speeds + j] = own[bound + j] = 0.0
    for _ in range(PASSES * n):
        least_squares(own, at, damping2, radial, vertical)
        part, first, at_most = 1.0, 0, 0.0
        for j in range(1, n):
            if own[bound + j] != 0.0:
                continue
            speed, goal = own[speeds + j], own[wanted + j]
            limit = own[most + j] if goal > speed else own[least + j]
            beyond = goal - limit if goal > speed else limit - goal
            if beyond > NOTHING and (limit - speed) / (goal - speed) < part:
                part, first, at_most = (limit - speed) / (goal - speed), j, limit
        for j in range(1, n):
            if own[bound + j] == 0.0:
                own[speeds + j] += part * (own[wanted + j] - own[speeds + j])
        if first:
            own[bound + first] = 1.0 if own[wanted + first] > at_most else -1.0
            own[speeds + first] = at_most
            continue
        farthest, leaves = NOTHING, 0
        for j in range(1, n):
            inward = own[bound + j] * (own[speeds + j] - own[wanted + j])
            if inward > farthest:
                farthest, leaves = inward, j
        if not leaves:
            break
        own[bound + leaves] = 0.0
    for j in range(1, n):  # rounding must not pass a limit
        own[speeds + j] = min(max(own[speeds + j], own[least + j]), own[most + j])


def solve(
    own: Numbers, at: int, angles: Numbers, radial: float, tangential: float, vertical: float
) -> float:
    """Fill the joints' speeds, and what the soft stops leave, for a tip velocity along the arm.

    Return the scale that brings all joints within their speeds and keeps the tip's direction, which
    cutting single joints would not. Towards a singularity it rises to 1, so that a direction that
    is about to be lost does not slow the others.
    """
    base, step = at + TABLES, int(own[at + STRIDE])
    n, width, low = int(own[at + JOINTS]), own[at + WIDTH], base + LOW * step
    high, full, speeds = base + HIGH * step, base + FULL * step, base + SPEEDS * step
    wanted, bound = base + WANTED * step, base + BOUND * step
    least, most, factors = base + LEAST * step, base + MOST * step, base + FACTORS * step
    column_r, column_z = base + COLUMN_R * step, base + COLUMN_Z * step
    put_columns(own, at, angles)
    # The first pitch axis may be before the slew axis.
    reach = own[base + LENGTH * step] - own[column_z + 1]
    over_axis = damp(own, at, reach * reach)
    own[wanted] = tangential * reach / (reach * reach + over_axis)
    for j in range(n):
        own[bound + j], own[factors + j] = 0.0, 1.0
    far = free(own, at, angles)
    near = -1.0 if far else weighted(own, at, angles)
    floor = least_damping(own, at, angles)
    damping2 = least_squares(own, at, near if far else max(near, floor), radial, vertical)
    damping2 = damping2 if far else near
    regular = far and damping2 == over_axis == 0.0
    scale = 1.0
    for j in range(n):
        size, damped = abs(own[wanted + j]), (damping2 if j else over_axis) / own[at + DAMPING2]
        if size > own[full + j] and size > NOTHING:
            lift = 1.0 - math.sqrt(max(1.0 - damped, 0.0))
            scale = min(scale, lift + (1.0 - lift) * own[full + j] / size)
    if regular:
        for j in range(n):
            own[speeds + j] = scale * own[wanted + j]
        return scale
    for j in range(n):
        own[least + j] = -own[full + j] * left(angles[j] - own[low + j], width)
        own[most + j] = own[full + j] * left(own[high + j] - angles[j], width)
    own[speeds] = min(max(scale * own[wanted], own[least]), own[most])
    asked = math.sqrt(radial * radial + vertical * vertical)
    if asked > 0.0:  # rows along what is asked for and across it
        cos, sin = radial / asked, vertical / asked
        for j in range(1, n):
            r, z = own[column_r + j], own[column_z + j]
            own[column_r + j], own[column_z + j] = cos * r + sin * z, ASTRAY * (cos * z - sin * r)
    bounded(own, at, max(damping2, floor), scale * asked, 0.0)
    put_factors(own, at, angles)
    return scale


def solve_base(own: Numbers, at: int, angles: Numbers, x: float, y: float, z: float) -> float:
    """Solve for a tip velocity in the base frame."""
    base, step = at + TABLES, int(own[at + STRIDE])
    bearing = angles[0] + own[base + OFFSET * step]
    cos, sin = math.cos(bearing), math.sin(bearing)
    return solve(own, at, angles, cos * x + sin * y, cos * y - sin * x, z)


def command(own: Numbers, at: int, axes: Numbers, angles: Numbers, out: Numbers) -> None:
    """Fill the command: joint speeds, scale, what the soft stops leave."""
    base, step = at + TABLES, int(own[at + STRIDE])
    n, axis, factor = int(own[at + JOINTS]), base + AXIS * step, base + FACTOR * step
    speeds, factors = base + SPEEDS * step, base + FACTORS * step
    scale = 1.0
    if own[at + RESOLVED] == 0.0:
        for j in range(n):
            own[speeds + j] = own[factor + j] * shape(own, at, axes[int(own[axis + j])])
            own[factors + j] = 1.0
        if not free(own, at, angles):
            put_factors(own, at, angles)
            for j in range(n):
                own[speeds + j] *= own[factors + j]
    else:
        x = own[factor] * own[at + SPEED] * shape(own, at, axes[int(own[axis])])
        y = own[factor + 1] * own[at + SPEED] * shape(own, at, axes[int(own[axis + 1])])
        z = own[factor + 2] * own[at + SPEED] * shape(own, at, axes[int(own[axis + 2])])
        if own[at + BASE] != 0.0:
            scale = solve_base(own, at, angles, x, y, z)
        else:
            scale = solve(own, at, angles, x, y, z)
    out[n] = scale
    for j in range(n):
        out[j] = own[speeds + j]
        out[n + 1 + j] = own[factors + j]


def hands(
    own: Numbers, at: int, angles: Numbers, x: float, y: float, z: float, axes: Numbers
) -> None:
    """Fill the axes that ask for a tip velocity in the base frame."""
    base, step = at + TABLES, int(own[at + STRIDE])
    n, axis, factor = int(own[at + JOINTS]), base + AXIS * step, base + FACTOR * step
    if own[at + RESOLVED] == 0.0:
        solve_base(own, at, angles, x, y, z)
        speeds, factors = base + SPEEDS * step, base + FACTORS * step
        for j in range(n):
            speed, remains = own[speeds + j], own[factors + j]
            if abs(speed) > NOTHING and remains > 0.0:
                share = speed / (own[factor + j] * remains)
                axes[int(own[axis + j])] = unshape(own, at, share)
        return
    if own[at + BASE] == 0.0:
        bearing = angles[0] + own[base + OFFSET * step]
        cos, sin = math.cos(bearing), math.sin(bearing)
        x, y = cos * x + sin * y, cos * y - sin * x
    most = max(abs(x), abs(y), abs(z), own[at + SPEED])
    axes[int(own[axis])] = own[factor] * unshape(own, at, x / most)
    axes[int(own[axis + 1])] = own[factor + 1] * unshape(own, at, y / most)
    axes[int(own[axis + 2])] = own[factor + 2] * unshape(own, at, z / most)


def active(own: FloatArray) -> int:
    """Return where the block of the active law begins."""
    return int(own[FIRST] if own[ACTIVE] == 0.0 else own[SECOND])


def tick(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
    """Make the command of a tick."""
    axes, out = (
        row[places[kernel.AXES] : places[kernel.COMMAND]],
        row[places[kernel.COMMAND] : places[kernel.STATE]],
    )
    if own[SWITCHES] != 0.0:
        down = own[BUTTON_SIGN] * axes[int(own[BUTTON])] > 0.5  # noqa: PLR2004 - as in the class
        if down and own[DOWN] == 0.0:
            own[ACTIVE] = 1.0 - own[ACTIVE]
        own[DOWN] = 1.0 if down else 0.0
        out[len(out) - 1] = own[ACTIVE]
        step = own[STEP] if own[ACTIVE] != 0.0 else -own[STEP]
        share = min(1.0, max(0.0, own[SHARE] + step))
        own[SHARE] = share
        if share not in (0.0, 1.0):
            angles, size = seen[places[kernel.STATE] :], len(out) - 1
            other = np.empty(size)
            command(own, int(own[FIRST]), axes, angles, other)
            command(own, int(own[SECOND]), axes, angles, out)
            for k in range(size):
                out[k] = (1.0 - share) * other[k] + share * out[k]
            return kernel.MADE
    command(own, active(own), axes, seen[places[kernel.STATE] :], out)
    return kernel.MADE


def inverse(
    own: FloatArray, places: Places, velocity: FloatArray, seen: FloatArray, row: FloatArray
) -> int:
    """Put the axes that ask for a tip velocity into the row."""
    axes = row[places[kernel.AXES] : places[kernel.COMMAND]]
    axes[:] = 0.0
    angles = seen[places[kernel.STATE] :]
    hands(own, active(own), angles, velocity[0], velocity[1], velocity[2], axes)
    return kernel.MADE
