"""Bars of the operator's controls, of joints and of loads, against their limits."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from labcrane.machines.machine import Joint
from labcrane.web.panels import LOAD, SHARE, said

AXES = "axes."
NEAR = 0.95
"""From this share of a limit on a bar warns."""

FULL = {"%": 100.0, "1": 1.0}


def groups(
    newest: Mapping[str, float],
    units: Mapping[str, str],
    joints: Sequence[Joint],
    moved: Collection[str],
) -> list[dict[str, Any]]:
    """Return the bars, by groups, ready for JSON.

    Parameters
    ----------
    newest
        The newest frame, by column.
    units
        Of each column.
    moved
        Columns of the controls that have moved: the others are only named.
    """
    still = [name.removeprefix(AXES) for name in newest if name.startswith(AXES)]
    still = [name for name in still if AXES + name not in moved]
    rest = f"at rest: {', '.join(still)}" if still else ""
    sticks = _sticks({name: newest[name] for name in newest if name in moved}, units)
    bars = _joints(newest, joints)
    return [
        {"title": "Sticks", "bars": sticks, "none": rest if newest else "No control was read yet."},
        {"title": "Joints", "bars": bars, "none": "" if bars else "No joint has moved yet."},
        *_loads(newest, units, joints),
    ]


def _sticks(newest: Mapping[str, float], units: Mapping[str, str]) -> list[dict[str, Any]]:
    found = []
    for column, value in newest.items():
        if column.startswith(AXES):
            unit = units.get(column, "1")
            full = max(FULL.get(unit, 1.0), abs(value) if math.isfinite(value) else 0.0)
            found.append(_bar(column.removeprefix(AXES), value, -full, full, f"{value:+.2f}"))
    return found


def _joints(newest: Mapping[str, float], joints: Sequence[Joint]) -> list[dict[str, Any]]:
    found = []
    for joint in joints:
        angle = newest.get(f"state.joint.angle.{joint.name}", math.nan)
        low, high = joint.limits
        text = f"{math.degrees(angle):.1f}° of {joint.range_deg[0]:g} to {joint.range_deg[1]:g}"
        if math.isfinite(angle):
            near = min(angle - low, high - angle) < (1.0 - NEAR) / 2.0 * (high - low)
            level = "warn" if near else ""
            found.append(_bar(joint.name, angle, low, high, text, level=level))
    return found


def _loads(
    newest: Mapping[str, float], units: Mapping[str, str], joints: Sequence[Joint]
) -> list[dict[str, Any]]:
    bars = []
    for joint in joints:
        column = f"{LOAD}.{joint.name}"
        if column in newest:
            load, unit = newest[column], units.get(column, SHARE)
            full = 1.0 if unit == SHARE else joint.effort
            share = abs(load) / full if math.isfinite(load) else 0.0
            level = "bad" if share >= 1.0 else "warn" if share >= NEAR else ""
            text = said(load, unit, joint)
            bars.append(
                _bar(joint.name, load, -full, full, text, level=level, ident=f"load-{joint.name}")
            )
    return [{"title": "Torques", "bars": bars, "none": ""}] if bars else []


def _bar(
    name: str, value: float, low: float, high: float, text: str, *, level: str = "", ident: str = ""
) -> dict[str, Any]:
    """Return a bar that reaches from zero, or the end that is nearest to it, to ``value``."""

    def place(of: float) -> float:
        return 100.0 * (min(max(of, low), high) - low) / (high - low)

    zero = place(0.0)
    at = place(value) if math.isfinite(value) else zero
    return {
        "name": name,
        "text": text if math.isfinite(value) else "not known",
        "level": level,
        "ident": ident or f"bar-{name}".replace(".", "-"),
        "zero": round(zero, 1),
        "from": round(min(zero, at), 1),
        "width": round(abs(at - zero), 1),
    }
