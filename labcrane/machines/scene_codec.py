"""Codec of placed objects: a scene in a form that can be recorded and sent."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any

from labcrane.machines.human_figure import Geom, ShapeKind
from labcrane.machines.mesh import read_mesh, write_mesh
from labcrane.machines.scene import PlacedObject

SCENE_PLACED = "scene.placed"
"""Event with which a task says what stands where in the trial that begins: its ``things`` are this
text. A thing that can move has the state signals ``scene.NAME.position`` and ``.orientation``."""


def write_placed(placed: Iterable[PlacedObject]) -> str:
    """Return the things as JSON."""
    return json.dumps([_fields(each) for each in placed])


def read_placed(text: str) -> tuple[PlacedObject, ...]:
    """Return what :func:`write_placed` wrote; nothing for an empty text."""
    return tuple(_placed(found) for found in json.loads(text or "[]"))


def _fields(placed: PlacedObject) -> dict[str, Any]:
    plain = replace(placed, parts=tuple(replace(part, mesh=None) for part in placed.parts))
    fields = asdict(plain)
    for part, found in zip(placed.parts, fields["parts"], strict=True):
        found["mesh"] = write_mesh(part.mesh)
    return fields


def _placed(found: Mapping[str, Any]) -> PlacedObject:
    parts = tuple(_part(part) for part in found["parts"])
    return PlacedObject(**{**found, "parts": parts, "position": tuple(found["position"])})


def _part(found: Mapping[str, Any]) -> Geom:
    size, centre = tuple(found["size"]), tuple(found["centre"])
    mesh = read_mesh(found["mesh"])
    return Geom(found["name"], ShapeKind(found["shape"]), size, centre, found["yaw"], mesh)
