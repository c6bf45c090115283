"""What a marker says: docs/markers.md describes this for whoever reads the stream."""

import json
import math
from collections.abc import Mapping

from labcrane.errors import PluginError
from labcrane.records import Event, Value

OTHER = 1
"""Code of an event that has no code of its own."""

CODES: Mapping[str, int] = {
    "session.start": 10,
    "session.end": 11,
    "step.start": 12,
    "step.end": 13,
    "instructions.shown": 14,
    "waiting": 15,
    "break.start": 16,
    "break.end": 17,
    "block.start": 20,
    "block.end": 21,
    "trial.start": 30,
    "trial.end": 31,
    "pause.start": 32,
    "pause.end": 33,
    "targets.shown": 40,
    "target.entered": 41,
    "command.onset": 50,
    "movement.onset": 51,
    "movement.offset": 52,
    "order.start": 60,
    "order.pause": 61,
    "order.repeat": 62,
    "order.skip": 63,
    "order.end": 64,
    "order.note": 65,
    "order.override": 66,
    "order.completion": 67,
    "input.lost": 90,
    "input.back": 91,
}
"""Codes of the numeric marker stream. A number, once given, never changes its meaning."""


def payload(event: Event, tick: int) -> str:
    """Return an event as one line of JSON: ``{"event": ..., "tick": ..., **data}``.

    JSON has no NaN and no infinity: such a number is null.

    Raises
    ------
    PluginError
        When the event's data use the keys ``event`` or ``tick``.
    """
    if "event" in event.data or "tick" in event.data:
        raise PluginError(
            f"event {event.name!r} has data named 'event' or 'tick', which name the event itself; "
            "rename them"
        )
    content: dict[str, Value] = {"event": event.name, "tick": tick, **event.data}
    try:
        return json.dumps(content, ensure_ascii=False, allow_nan=False)
    except ValueError:
        return json.dumps(
            {key: _finite(value) for key, value in content.items()}, ensure_ascii=False
        )


def _finite(value: Value) -> Value:
    return None if isinstance(value, float) and not math.isfinite(value) else value
