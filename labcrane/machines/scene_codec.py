"""Codec of placed objects: a scene in a form that can be recorded and sent."""

import json
from collections.abc import Iterable
from functools import cache

from pydantic import TypeAdapter

from labcrane.machines.scene import PlacedObject

SCENE_PLACED = "scene.placed"
"""Event with which a task says what stands where in the trial that begins: its ``things`` are this
text. A thing that can move has the state signals ``scene.NAME.position`` and ``.orientation``."""


@cache
def _codec() -> TypeAdapter[tuple[PlacedObject, ...]]:
    return TypeAdapter(tuple[PlacedObject, ...])


def write_placed(placed: Iterable[PlacedObject]) -> str:
    """Return the things as JSON."""
    return json.dumps(_codec().dump_python(tuple(placed), mode="json"))


def read_placed(text: str) -> tuple[PlacedObject, ...]:
    """Return what :func:`write_placed` wrote; nothing for an empty text."""
    return _codec().validate_json(text or "[]")
