"""Sliders: the settings of cues and sounds that can be changed while a session runs."""

import math
from collections.abc import Mapping
from typing import Any, get_args

from labcrane.core.records import Value
from labcrane.core.settings import Settings
from labcrane.files.units import unit_of

STEPS = 200
"""Of a slider from end to end."""

WIDE = 3.0
"""A number without bounds can be set to this many times what the protocol says."""


def sliders(name: str, settings: Settings, changed: Mapping[str, Value]) -> list[dict[str, Any]]:
    """Return a control for each setting of a cue or sound that is a single value, ready for JSON.

    Parameters
    ----------
    settings
        As the protocol has them.
    changed
        What has been changed since, by key.
    """
    found = []
    schema = type(settings).model_json_schema()["properties"]
    for key, field in type(settings).model_fields.items():
        written = getattr(settings, key)
        now = changed.get(key, written)
        said = schema.get(key, {})
        number = (each for each in said.get("anyOf", ()) if each.get("type") == "number")
        control = _control(next(number, said), field, written)
        if control is None:
            continue
        unit = unit_of(key, field.metadata) or ""
        about = str(said.get("description", "")).partition("\n")[0]
        ident = f"{name}-{key}"
        found.append(
            {"ident": ident, "place": f"{name}.{key}", "key": key.replace("_", " "), "now": now,
             "unit": str(unit), "about": about, "protocol": written, **control}
        )  # fmt: skip
    return found


def _control(schema: Mapping[str, Any], field: Any, written: object) -> dict[str, Any] | None:
    if isinstance(written, bool):
        return {"kind": "choice", "choices": ["true", "false"]}
    choices = [one for one in get_args(field.annotation) if isinstance(one, str)]
    if isinstance(written, str) and choices:
        return {"kind": "choice", "choices": choices}
    if not isinstance(written, int | float):
        return None
    low, high = _bounds(schema, float(written))
    whole = isinstance(written, int)
    step = 1.0 if whole else _rounded((high - low) / STEPS)
    if "exclusiveMinimum" in schema and low == schema["exclusiveMinimum"]:
        low += step
    if "exclusiveMaximum" in schema and high == schema["exclusiveMaximum"]:
        high -= step
    return {"kind": "range", "low": low, "high": high, "step": step, "whole": whole}


def _bounds(schema: Mapping[str, Any], written: float) -> tuple[float, float]:
    """Return where a slider ends: where the model says, or far enough about what is written."""
    low = schema.get("minimum", schema.get("exclusiveMinimum"))
    high = schema.get("maximum", schema.get("exclusiveMaximum"))
    span = float(f"{WIDE * abs(written):.6g}") or 1.0  # 0.45, not 0.4499...
    if low is None:
        low = -span if written < 0 else 0.0
    if high is None:
        high = max(span, float(low) + 1e-6)
    return float(low), float(high)


def _rounded(step: float) -> float:
    """Return the step of one digit that is not larger."""
    size = 10.0 ** math.floor(math.log10(step)) if step > 0 else 0.01
    return float(f"{max(1, math.floor(step / size)) * size:.6g}")
