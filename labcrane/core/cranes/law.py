"""Law of a crane: the actuator, the velocity law and the tip, tick by tick.

:mod:`labcrane.core.compiled` compiles the functions for a simulation; the tip's is Python's too.
With an engine, the law holds while every motor has the torque for it and no joint is near a limit;
all other ticks are the engine's.
"""

import math
from collections.abc import Sequence

import numpy as np

from labcrane.core import kernel
from labcrane.core.kernel import Places
from labcrane.machines.machine import GRAVITY, Machine
from labcrane.types import FloatArray

Numbers = Sequence[float] | FloatArray
MutableNumbers = list[float] | FloatArray

JOINTS, DELAY, DT, BASE_X, HEIGHT, DRIVE, CHANGES, IDEAL, SHARE = range(9)
"""Joints, ticks of dead time, length of a tick, the foot, the first command and where what changes
begins; then the actuator's constants. Rows of :data:`TABLES` follow."""
TABLES = 10
"""Where the largest changes are, then lowest and highest angles, lengths and offsets. What changes
comes behind them: angles, speeds and the actuator's state (:func:`lag`)."""


def lag(moving: MutableNumbers, command: Numbers, delay: int, share: float, most: Numbers) -> None:
    """Change an actuator's speeds by a command.

    Behind the speeds are the commands on their way, as a ring, and which of them is due.
    """
    n = len(command)
    due = n + n * int(moving[-1])
    for j in range(n):
        change = share * ((moving[due + j] if delay > 0 else command[j]) - moving[j])
        moving[j] += most[j] if change > most[j] else (-most[j] if change < -most[j] else change)
    if delay > 0:
        moving[due : due + n] = command
        moving[-1] = (moving[-1] + 1.0) % delay


def follow(own: FloatArray, at: int, command: FloatArray, speeds: FloatArray) -> None:
    """Fill the speeds that come of a command."""
    n = len(speeds)
    if own[IDEAL] != 0.0:
        speeds[:] = command
        return
    moving = own[at + 2 * n :]
    lag(moving, command, int(own[DELAY]), own[SHARE], own[TABLES : TABLES + n])
    speeds[:] = moving[:n]


def turn(
    angles: MutableNumbers, speeds: MutableNumbers, lowest: Numbers, highest: Numbers, dt: float
) -> None:
    """Turn joints for a tick; one that comes to an end of its range stops there."""
    for j in range(len(speeds)):
        angle = angles[j] + speeds[j] * dt
        if not lowest[j] <= angle <= highest[j]:
            angle = lowest[j] if angle < lowest[j] else highest[j]
            speeds[j] = 0.0
        angles[j] = angle


def tip_motion(
    angles: Numbers, speeds: Numbers, lengths: Numbers, offsets: Numbers, foot: float,
    base_x: float, height: float, bearing: float,
) -> tuple[float, float, float, float, float, float]:  # fmt: skip
    """Return the tip's position in m and velocity in m/s.

    Parameters
    ----------
    angles, speeds
        Of all joints, in rad and rad/s.
    lengths, offsets
        Of the links that pitch, in m and rad.
    foot, base_x, height
        Where the first pitch axis is, from the slew axis, that in the base, and above it, in m; the
        first may be before the second.
    bearing
        Where the arm points, in rad.
    """
    pitch = turning = outward = upward = 0.0
    radius = foot
    for angle, speed, length, offset in zip(angles[1:], speeds[1:], lengths, offsets):  # noqa: B905 - numba
        pitch += angle + offset
        turning += speed
        forward, down = length * math.cos(pitch), length * math.sin(pitch)
        radius += forward
        height -= down
        outward -= down * turning
        upward -= forward * turning
    ahead, left = math.cos(bearing), math.sin(bearing)
    sideways = radius * speeds[0]
    return (
        base_x + radius * ahead,
        radius * left,
        height,
        outward * ahead - sideways * left,
        outward * left + sideways * ahead,
        upward,
    )


def put_tip(own: FloatArray, angles: FloatArray, speeds: FloatArray, tip: FloatArray) -> None:
    """Fill the tip's position and velocity."""
    n = len(angles)
    length, offset = TABLES + 3 * n, TABLES + 4 * n
    tip[0], tip[1], tip[2], tip[3], tip[4], tip[5] = tip_motion(
        angles, speeds, own[length + 1 : offset], own[offset + 1 : offset + n],
        own[length], own[BASE_X], own[HEIGHT], angles[0] + own[offset],
    )  # fmt: skip


def step(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
    """Move the crane for a tick."""
    n, at, dt = int(own[JOINTS]), int(own[CHANGES]), own[DT]
    state, drive = places[kernel.STATE], places[kernel.COMMAND] + int(own[DRIVE])
    angles, speeds = row[state : state + n], row[state + n : state + 2 * n]
    follow(own, at, row[drive : drive + n], speeds)
    low, high = TABLES + n, TABLES + 2 * n
    turn(own[at : at + n], speeds, own[low:high], own[high : high + n], dt)
    angles[:] = own[at : at + n]
    put_tip(own, angles, speeds, row[state + 2 * n : state + 2 * n + 6])
    return kernel.MADE


MASS, CENTRE, ALONG, ACROSS, UPRIGHT, EFFORT = range(6)
"""Of every link, behind the other tables: mass, centre of mass along it, moments of inertia about
its axes; and its joint's torque."""
NEAR = 1e-3
"""Distance from a limit in rad within which the engine's solver pushes back."""
ENOUGH = 0.999
"""Share of a motor's torque up to which rounding cannot tell otherwise."""


def torques_suffice(
    own: FloatArray, angles: FloatArray, speeds: FloatArray, asked: FloatArray, loads: FloatArray
) -> bool:
    """Whether motors can change the joints' speeds to what is asked for within a tick.

    Fill their loads, if they can.

    Newton's and Euler's equations in the vertical plane that turns with the slew.
    """
    n, dt = len(angles), own[DT]
    length, offset, link = TABLES + 3 * n, TABLES + 4 * n, TABLES + 5 * n
    slew, faster = speeds[0], (asked[0] - speeds[0]) / dt
    about_slew = own[link + UPRIGHT * n] * faster
    # Of every link: moment, push and lift, the moment of both about the foot, and its joint.
    moment, push, lift = np.empty(n), np.empty(n), np.empty(n)
    joint_r, joint_z = np.empty(n), np.empty(n)
    pitch = turn = spin = r = dr = ddr = z = ddz = 0.0
    for k in range(1, n):
        pitch += angles[k] + own[offset + k]
        turn += speeds[k]
        spin += (asked[k] - speeds[k]) / dt
        joint_r[k], joint_z[k] = r, z
        c, s = math.cos(pitch), math.sin(pitch)
        mass, centre = own[link + MASS * n + k], own[link + CENTRE * n + k]
        ixx, izz = own[link + ALONG * n + k], own[link + UPRIGHT * n + k]
        at_r, at_z = r + centre * c, z - centre * s
        at_dr = dr - centre * s * turn
        push[k] = mass * (ddr - centre * (c * turn * turn + s * spin) - at_r * slew * slew)
        lift[k] = mass * (ddz + centre * (s * turn * turn - c * spin) + GRAVITY)
        moment[k] = own[link + ACROSS * n + k] * spin + slew * slew * (izz - ixx) * s * c
        moment[k] += at_z * push[k] - at_r * lift[k]
        about_slew += at_r * mass * (at_r * faster + 2.0 * at_dr * slew)
        about_slew += 2.0 * (ixx - izz) * s * c * turn * slew
        about_slew += (ixx * s * s + izz * c * c) * faster
        reach = own[length + k]
        r, z = r + reach * c, z - reach * s
        dr -= reach * s * turn
        ddr -= reach * (c * turn * turn + s * spin)
        ddz += reach * (s * turn * turn - c * spin)
    moments = pushes = lifts = 0.0
    for k in range(n - 1, 0, -1):
        moments, pushes, lifts = moments + moment[k], pushes + push[k], lifts + lift[k]
        about_joint = moments - joint_z[k] * pushes + joint_r[k] * lifts
        loads[k] = about_joint / own[link + EFFORT * n + k]
        if abs(loads[k]) > ENOUGH:
            return False
    loads[0] = about_slew / own[link + EFFORT * n]
    return bool(abs(loads[0]) <= ENOUGH)


def step_engine(own: FloatArray, places: Places, seen: FloatArray, row: FloatArray) -> int:
    """Move the engine's crane for a tick, if its motors can."""
    n, at, dt = int(own[JOINTS]), int(own[CHANGES]), own[DT]
    state, drive = places[kernel.STATE], places[kernel.COMMAND] + int(own[DRIVE])
    angles, speeds = row[state : state + n], row[state + n : state + 2 * n]
    follow(own, at, row[drive : drive + n], speeds)
    before, was = own[at : at + n], own[at + n : at + 2 * n]
    loads = row[state + 2 * n + 6 : state + 3 * n + 6]
    if not torques_suffice(own, before, was, speeds, loads):
        return kernel.DECLINED
    low, high = TABLES + n, TABLES + 2 * n
    for j in range(n):
        angle = before[j] + speeds[j] * dt
        if not own[low + j] + NEAR < angle < own[high + j] - NEAR:
            return kernel.DECLINED
        angles[j] = angle
    row[state + 3 * n + 6 : state + 4 * n + 6] = 0.0  # no motor gives all it has
    own[at : at + n], own[at + n : at + 2 * n] = angles, speeds
    put_tip(own, angles, speeds, row[state + 2 * n : state + 2 * n + 6])
    return kernel.MADE


def links_of(machine: Machine) -> list[float]:
    """Return the links' masses, centres and moments of inertia, as in the URDF, and efforts."""
    slew, *chain = machine.joints
    wide = slew.thickness * slew.thickness
    upright = [slew.mass_kg / 12.0 * 2.0 * wide]
    along, across = [0.0], [0.0]  # the column turns about its own axis only
    for joint in chain:
        x, side = (edge * edge for edge in (joint.a or joint.thickness, joint.thickness))
        along.append(joint.mass_kg / 12.0 * 2.0 * side)
        across.append(joint.mass_kg / 12.0 * (x + side))
        upright.append(joint.mass_kg / 12.0 * (x + side))
    masses = [joint.mass_kg for joint in machine.joints]
    centres = [0.0, *(0.5 * joint.a for joint in chain)]
    efforts = [joint.effort for joint in machine.joints]
    return [*masses, *centres, *along, *across, *upright, *efforts]
