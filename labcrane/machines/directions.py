"""Directions: which way the machine goes when a stick is pushed, in words.

A machine goes where the stick points: to the right turns right, a pull lifts or draws in, and the
last link curls in to the left. So it is on excavators (ISO 10968, SAE J1177) and on cranes with
two sticks. A control panel's valve that extends lifts.
"""

from collections.abc import Mapping

from labcrane.machines.kinematics import jacobian, link_frames
from labcrane.machines.machine import Machine

STICKS = ("left.x", "left.y", "right.x", "right.y")
"""Axes of two sticks: x is positive to the right, y towards the operator."""

NEAR_M = 1e-9
"""So near to the slew axis the tip is in no direction from it."""

VALVE = "valve."
"""Axes of a control panel, one for each joint; positive signals extend."""

WAYS = {
    "x": ("away from you", "towards you"),
    "y": ("to the left", "to the right"),
    "z": ("up", "down"),
    "radial": ("away from you", "towards you"),
    "tangential": ("to the left", "to the right"),
    "vertical": ("up", "down"),
}
"""Where the tip goes along each direction: forward, and backward."""

USUAL = {
    ("y", "x"): -1.0,
    ("tangential", "x"): -1.0,
    ("x", "y"): -1.0,
    ("radial", "y"): -1.0,
    ("z", "y"): 1.0,
    ("vertical", "y"): 1.0,
}
"""With which sign the tip goes where the stick points: by direction of the tip, and x or y of the
stick. A pull draws it in, or lifts it."""


def of_joints(machine: Machine, written: Mapping[str, str]) -> tuple[str, ...]:
    """Return a sentence for each axis of a map to joints that states its effect."""
    return tuple(
        _said(axis, _joint_goes(machine, joint, _sign(axis))) for joint, axis in written.items()
    )


def of_the_tip(written: Mapping[str, str]) -> tuple[str, ...]:
    """Return a sentence for each axis of a map to tip directions that states its effect."""
    return tuple(_said(axis, _tip_goes(way, _sign(axis))) for way, axis in written.items())


def doubted_joints(machine: Machine, written: Mapping[str, str]) -> Mapping[str, str]:
    """Return the axes of two sticks that turn a joint the other way, by key of the settings."""
    slew, first, last = machine.joints[0], machine.joints[1], machine.joints[-1]
    # A positive slew is to the left, a positive pitch down.
    usual = {(slew.name, "x"): -1.0, (first.name, "y"): -1.0}
    if last.a:  # else it carries nothing, and is a gripper
        usual[last.name, "x"] = -1.0
    found = {
        f"map.{joint}": _doubt(axis, _joint_goes(machine, joint, _sign(axis)))
        for joint, axis in written.items()
        if _is_unusual(joint, axis, usual)
    }
    if written.get(first.name) == f"{VALVE}{first.name}":
        found["map"] = (
            f"leaves {first.name} to {VALVE}{first.name}, so that the "
            f"{_joint_goes(machine, first.name, 1.0)} when its valve extends; where it lifts on "
            f"your machine, write map: {{{first.name}: -{VALVE}{first.name}}}"
        )
    return found


def doubted_ways(written: Mapping[str, str]) -> Mapping[str, str]:
    """Return the axes of two sticks that move the tip the other way, by key of the settings."""
    return {
        f"map.{way}": _doubt(axis, _tip_goes(way, _sign(axis)))
        for way, axis in written.items()
        if _is_unusual(way, axis, USUAL)
    }


def _is_unusual(moved: str, axis: str, usual: Mapping[tuple[str, str], float]) -> bool:
    name, sign = axis.removeprefix("-"), _sign(axis)
    return name in STICKS and usual.get((moved, name[-1]), sign) != sign


def _doubt(axis: str, goes: str) -> str:
    other = axis[1:] if axis.startswith("-") else f"-{axis}"
    stick, _, where = _pushed(axis).partition(" stick ")
    return (
        f"is {axis}, so that the {goes} when the {stick} stick is moved {where}; "
        f"with {other} it is the other way round"
    )


def _said(axis: str, goes: str) -> str:
    return f"{_pushed(axis)}: the {goes}"


def _pushed(axis: str) -> str:
    name = axis.removeprefix("-")
    side, _, way = name.partition(".")
    where = {"x": "to the right", "y": "towards you"}
    if name.startswith(VALVE):
        return f"{name} extends"
    return f"{side} stick {where[way]}" if name in STICKS else f"{name} forward"


def _sign(axis: str) -> float:
    return -1.0 if axis.startswith("-") else 1.0


def _joint_goes(machine: Machine, joint: str, sign: float) -> str:
    if joint == machine.joints[0].name:
        return f"{joint} turns {WAYS['y'][sign < 0.0]}"
    if joint == machine.joints[-1].name and not machine.joints[-1].a:
        return f"{joint} turns to {'larger' if sign > 0.0 else 'smaller'} angles"
    import numpy as np  # noqa: PLC0415 - with NumPy, which few protocols need to be checked

    moved = sign * jacobian(machine, machine.rest)[:, machine.names.index(joint)]
    tip = link_frames(machine, machine.rest)[-1][:2, 3]
    outward, upward = float(moved[:2] @ tip / max(np.linalg.norm(tip), NEAR_M)), float(moved[2])
    way, far = ("z", upward) if abs(upward) >= abs(outward) else ("x", outward)
    return f"{joint} moves the tip {WAYS[way][far < 0.0]} from rest"


def _tip_goes(way: str, sign: float) -> str:
    return f"tip goes {WAYS[way][sign < 0.0]}"
