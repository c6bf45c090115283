"""Compiled schemes: the same arithmetic as the classes of this package, operation by operation.

What a scheme knows lies in one array: numbers of the scheme, then one block for each law.
"""

import math

import numpy as np

from labcrane import FloatArray
from labcrane.core import Places, compiled, kernel

ACTIVE, DOWN, SHARE, SWITCHES, BUTTON, BUTTON_SIGN, FIRST, SECOND, STEP = range(9)
"""Of the scheme: which law is active, whether the button is down, the second law's share of the
command, whether there is a button and where; where the blocks begin, and by how much the share
changes in a tick."""
CHANGING = 3
HEAD = 9

(
    RESOLVED, JOINTS, STICKS, EDGE, REST, LINEAR, EXPO, STRETCH, STEEPNESS, STRAIGHT, WIDTH, HOLDS,
    DAMPING2, THRESHOLD2, SPEED, BASE, STRIDE, TABLES,
) = range(18)  # fmt: skip
"""Layout of a block: whether it is resolved rate, then its numbers, then its tables."""
(
    AXIS,
    FACTOR,
    LOW,
    HIGH,
    LENGTH,
    OFFSET,
    FULL,
    COLUMN_R,
    COLUMN_Z,
    SPEEDS,
    FACTORS,
    SCALED_R,
    SCALED_Z,
    WEIGHTS,
) = range(14)
N_TABLES = 14
NOTHING = 1e-12


@compiled.part
def _table(at: int, stride: int, which: int) -> int:
    return at + 17 + which * stride


@compiled.part
def _shape(own: FloatArray, at: int, push: float) -> float:
    beyond = abs(push) - own[at + EDGE]
    if beyond <= 0.0:
        return 0.0
    x = beyond / own[at + REST]
    return math.copysign(x * (own[at + LINEAR] + own[at + EXPO] * x * x), push)


@compiled.part
def _unshape(own: FloatArray, at: int, share: float) -> float:
    if share == 0.0:
        return 0.0
    size = abs(share)
    x = size if size < 1.0 else 1.0
    if own[at + STRETCH] > 0.0:
        x = own[at + STRETCH] * math.sinh(math.asinh(own[at + STEEPNESS] * x) / 3.0)
    elif own[at + STRAIGHT] == 0.0:
        x = np.cbrt(x)
    push = own[at + EDGE] + own[at + REST] * x
    return math.copysign(push if push < 1.0 else 1.0, share)


@compiled.part
def _factor(low: float, high: float, width: float, angle: float, speed: float) -> float:
    if speed == 0.0:
        return 1.0
    room = high - angle if speed > 0.0 else angle - low
    if room >= width:
        return 1.0
    return room / width if room > 0.0 else 0.0


@compiled.part
def _free(own: FloatArray, at: int, angles: FloatArray) -> bool:
    stride, width = int(own[at + STRIDE]), own[at + WIDTH]
    low, high = _table(at, stride, LOW), _table(at, stride, HIGH)
    for j in range(int(own[at + JOINTS])):
        if not own[low + j] + width < angles[j] < own[high + j] - width:
            return False
    return True


@compiled.part
def _damp(own: FloatArray, at: int, singular2: float) -> float:
    threshold2 = own[at + THRESHOLD2]
    if singular2 >= threshold2:
        return 0.0
    damping2: float = own[at + DAMPING2] * (1.0 - singular2 / threshold2)
    return damping2


@compiled.part
def _pitch(
    own: FloatArray, at: int, r: FloatArray, z: FloatArray, radial: float, vertical: float,
    out: FloatArray,
) -> None:  # fmt: skip
    rr = rz = zz = 0.0
    for k in range(len(r)):
        rr += r[k] * r[k]
        rz += r[k] * z[k]
        zz += z[k] * z[k]
    threshold2 = own[at + THRESHOLD2]
    if rr < threshold2 or (rr - threshold2) * (zz - threshold2) <= rz * rz:
        apart, twice = rr - zz, 2.0 * rz
        largest = 0.5 * (rr + zz + math.sqrt(apart * apart + twice * twice))
        left = rr * zz - rz * rz
        small = (left if left > 0.0 else 0.0) / largest if largest > 0.0 else 0.0
        damp = _damp(own, at, small)
        rr += damp
        zz += damp
    det = rr * zz - rz * rz
    y_r = (zz * radial - rz * vertical) / det
    y_z = (rr * vertical - rz * radial) / det
    for k in range(len(r)):
        out[k] = r[k] * y_r + z[k] * y_z


@compiled.part
def _solve(
    own: FloatArray, at: int, angles: FloatArray, radial: float, tangential: float, vertical: float
) -> float:
    """Fill the tables of speeds and factors; return the scale."""
    n, stride, width = int(own[at + JOINTS]), int(own[at + STRIDE]), own[at + WIDTH]
    low, high = _table(at, stride, LOW), _table(at, stride, HIGH)
    length, offset = _table(at, stride, LENGTH), _table(at, stride, OFFSET)
    full = _table(at, stride, FULL)
    start = _table(at, stride, COLUMN_R)
    column_r = own[start : start + n - 1]
    start = _table(at, stride, COLUMN_Z)
    column_z = own[start : start + n - 1]
    start = _table(at, stride, SPEEDS)
    speeds, pitches = own[start : start + n], own[start + 1 : start + n]
    start = _table(at, stride, FACTORS)
    factors = own[start : start + n]
    pitch = 0.0
    for k in range(n - 1):
        pitch += angles[k + 1] + own[offset + k + 1]
        pitches[k] = pitch
    radius = drop = 0.0
    for k in range(n - 2, -1, -1):
        radius += own[length + k + 1] * math.cos(pitches[k])
        drop += own[length + k + 1] * math.sin(pitches[k])
        column_r[k], column_z[k] = -drop, -radius
    reach = own[length] - column_z[0]  # the first pitch axis may be before the slew axis
    reach2 = reach * reach
    slew = tangential * reach / (reach2 + _damp(own, at, reach2))
    if own[at + HOLDS] != 0.0:
        mean_r = mean_z = 0.0
        for k in range(n - 1):
            mean_r += column_r[k]
            mean_z += column_z[k]
        mean_r /= n - 1
        mean_z /= n - 1
        for k in range(n - 1):
            column_r[k] -= mean_r
            column_z[k] -= mean_z
    _pitch(own, at, column_r, column_z, radial, vertical, pitches)
    speeds[0] = slew
    factors[:] = 1.0
    if not _free(own, at, angles):
        if own[at + HOLDS] == 0.0:
            _relieve(own, at, angles, column_r, column_z, pitches, radial, vertical)
        for j in range(n):
            factors[j] = _factor(own[low + j], own[high + j], width, angles[j], speeds[j])
    scale = 1.0
    for j in range(n):
        size, most = abs(speeds[j]), own[full + j] * factors[j]
        if size * scale > most and size > NOTHING:
            scale = most / size
    return scale


@compiled.part
def _relieve(
    own: FloatArray, at: int, angles: FloatArray, column_r: FloatArray, column_z: FloatArray,
    pitches: FloatArray, radial: float, vertical: float,
) -> None:  # fmt: skip
    stride, width, links = int(own[at + STRIDE]), own[at + WIDTH], len(pitches)
    low, high = _table(at, stride, LOW), _table(at, stride, HIGH)
    start = _table(at, stride, WEIGHTS)
    weights = own[start : start + links]
    start = _table(at, stride, SCALED_R)
    scaled_r = own[start : start + links]
    start = _table(at, stride, SCALED_Z)
    scaled_z = own[start : start + links]
    weights[:] = 1.0
    for _ in range(links):
        relieved = False
        for k in range(links):
            j = k + 1
            factor = _factor(own[low + j], own[high + j], width, angles[j], pitches[k])
            if factor < weights[k]:
                weights[k] = factor
                relieved = True
        if not relieved:
            break
        for k in range(links):
            root = math.sqrt(weights[k])
            scaled_r[k], scaled_z[k] = root * column_r[k], root * column_z[k]
        _pitch(own, at, scaled_r, scaled_z, radial, vertical, pitches)
        for k in range(links):
            pitches[k] = math.sqrt(weights[k]) * pitches[k]


@compiled.part
def _solve_base(
    own: FloatArray, at: int, angles: FloatArray, x: float, y: float, z: float
) -> float:
    bearing = angles[0] + own[_table(at, int(own[at + STRIDE]), OFFSET)]
    cos, sin = math.cos(bearing), math.sin(bearing)
    return _solve(own, at, angles, cos * x + sin * y, cos * y - sin * x, z)


@compiled.part
def _command(
    own: FloatArray, at: int, axes: FloatArray, angles: FloatArray, out: FloatArray
) -> None:
    n, stride = int(own[at + JOINTS]), int(own[at + STRIDE])
    axis, factor = _table(at, stride, AXIS), _table(at, stride, FACTOR)
    speeds, factors = _table(at, stride, SPEEDS), _table(at, stride, FACTORS)
    scale = 1.0
    if own[at + RESOLVED] == 0.0:
        low, high = _table(at, stride, LOW), _table(at, stride, HIGH)
        for j in range(n):
            own[speeds + j] = own[factor + j] * _shape(own, at, axes[int(own[axis + j])])
            own[factors + j] = 1.0
        if not _free(own, at, angles):
            for j in range(n):
                own[factors + j] = _factor(
                    own[low + j], own[high + j], own[at + WIDTH], angles[j], own[speeds + j]
                )
                own[speeds + j] = own[speeds + j] * own[factors + j]
        for j in range(n):
            out[j] = own[speeds + j]
    else:
        x = own[factor] * own[at + SPEED] * _shape(own, at, axes[int(own[axis])])
        y = own[factor + 1] * own[at + SPEED] * _shape(own, at, axes[int(own[axis + 1])])
        z = own[factor + 2] * own[at + SPEED] * _shape(own, at, axes[int(own[axis + 2])])
        if own[at + BASE] != 0.0:
            scale = _solve_base(own, at, angles, x, y, z)
        else:
            scale = _solve(own, at, angles, x, y, z)
        for j in range(n):
            out[j] = scale * own[speeds + j]
    out[n] = scale
    for j in range(n):
        out[n + 1 + j] = own[factors + j]


@compiled.part
def _block(own: FloatArray) -> int:
    return int(own[FIRST] if own[ACTIVE] == 0.0 else own[SECOND])


@compiled.tick
def command(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
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
            _command(own, int(own[FIRST]), axes, angles, other)
            _command(own, int(own[SECOND]), axes, angles, out)
            for k in range(size):
                out[k] = (1.0 - share) * other[k] + share * out[k]
            return kernel.MADE
    _command(own, _block(own), axes, seen[places[kernel.STATE] :], out)
    return kernel.MADE


@compiled.inverse
def hands(
    own: FloatArray, places: Places, velocity: FloatArray, seen: FloatArray, row: FloatArray
) -> int:
    """Put the axes that ask for a tip velocity into the row."""
    at, angles = _block(own), seen[places[kernel.STATE] :]
    n, stride = int(own[at + JOINTS]), int(own[at + STRIDE])
    axis, factor = _table(at, stride, AXIS), _table(at, stride, FACTOR)
    x, y, z = velocity[0], velocity[1], velocity[2]
    axes = row[places[kernel.AXES] : places[kernel.COMMAND]]
    axes[:] = 0.0
    if own[at + RESOLVED] == 0.0:
        scale = _solve_base(own, at, angles, x, y, z)
        speeds, factors = _table(at, stride, SPEEDS), _table(at, stride, FACTORS)
        for j in range(n):
            speed, left = own[speeds + j], own[factors + j]
            if abs(speed) > NOTHING and left > 0.0:
                share = scale * speed / (own[factor + j] * left)
                axes[int(own[axis + j])] = _unshape(own, at, share)
        return kernel.MADE
    if own[at + BASE] == 0.0:
        bearing = angles[0] + own[_table(at, stride, OFFSET)]
        cos, sin = math.cos(bearing), math.sin(bearing)
        x, y = cos * x + sin * y, cos * y - sin * x
    most = max(abs(x), abs(y), abs(z), own[at + SPEED])
    axes[int(own[axis])] = own[factor] * _unshape(own, at, x / most)
    axes[int(own[axis + 1])] = own[factor + 1] * _unshape(own, at, y / most)
    axes[int(own[axis + 2])] = own[factor + 2] * _unshape(own, at, z / most)
    return kernel.MADE
