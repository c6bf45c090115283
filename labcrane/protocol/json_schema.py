"""The JSON Schema of a protocol, with the settings of everything that is installed, for editors."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from pydantic.json_schema import models_json_schema

from labcrane.core.roles import (
    Component,
    Controller,
    Cue,
    Dynamics,
    Feedback,
    InputDevice,
    Questionnaire,
    SignalMonitor,
    Task,
)
from labcrane.core.settings import Settings
from labcrane.protocol.protocol import Protocol
from labcrane.protocol.steps import Block, Break, Session
from labcrane.registry.offers import Offer
from labcrane.registry.registry import Registry

Schema = dict[str, Any]

ONE: Mapping[str, tuple[type[Component], ...]] = {
    "input": (InputDevice,),
    "operator": (InputDevice,),
    "scheme": (Controller,),
    "dynamics": (Dynamics,),
}
"""Keys of a protocol that name one component, and of which roles."""

BY_NAME: Mapping[str, tuple[type[Component], ...]] = {
    "tasks": (Task,),
    "questionnaires": (Questionnaire,),
    "monitors": (SignalMonitor,),
    "feedback": (Cue, Feedback),
    "views": (Feedback,),
}
"""Keys that hold components under names of the study's own."""


def protocol_schema(registry: Registry) -> Schema:
    """Return the JSON Schema (2020-12) of what a protocol may say with what is installed."""
    roles = [*ONE.values(), *BY_NAME.values()]
    settings = {
        offer.settings: None
        for group in roles
        for role in group
        for offer in registry.offers[role].values()
    }
    models: list[type[Settings]] = [Protocol, Session, Block, Break, *settings]
    references, whole = models_json_schema([(model, "validation") for model in models])
    shared: Schema = whole["$defs"]
    named = {model: shared[ref["$ref"].split("/")[-1]] for (model, _), ref in references.items()}

    protocol = named[Protocol]
    for key, of in ONE.items():
        protocol["properties"][key] = _use(registry, of, named)
    for key, of in BY_NAME.items():
        place = protocol["properties"][key]
        for part in (place, *place.get("anyOf", ())):
            if part.get("type") == "object":
                part |= {"additionalProperties": _use(registry, of, named)}
    named[Session]["properties"]["steps"]["items"] = _step(references[(Block, "validation")])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **protocol,
        "title": "A labcrane protocol",
        "$defs": shared,
    }


def _use(
    registry: Registry, roles: tuple[type[Component], ...], named: Mapping[Any, Schema]
) -> Schema:
    """Return the schema of ``{use: NAME, ...}``; the name decides which other keys there are."""
    offers = {name: each for role in roles for name, each in registry.offers[role].items()}
    return {
        "type": "object",
        "required": ["use"],
        "properties": {"use": {"enum": sorted(offers)}},
        "allOf": [
            {
                "if": {"properties": {"use": {"const": name}}, "required": ["use"]},
                "then": _with_use(offer, named),
            }
            for name, offer in sorted(offers.items())
        ],
    }


def _with_use(offer: Offer[Component], named: Mapping[Any, Schema]) -> Schema:
    model = deepcopy(named[offer.settings])
    model["properties"] = {"use": {"const": offer.name}, **model.get("properties", {})}
    return model


def _step(block: Schema) -> Schema:
    """Return the schema of a step in the form in which it is written, one key and its value."""
    name: Schema = {"type": "string"}
    kinds: dict[str, Schema] = {
        "instructions": {**name, "description": "A text file beside the protocol."},
        "questionnaire": {"anyOf": [name, {"type": "array", "items": name, "minItems": 1}]},
        "practice": block,
        "reference": block,
        "block": block,
        "break": {"$ref": "#/$defs/Break"},
    }
    return {
        "anyOf": [
            {"const": "consent"},
            {
                "type": "object",
                "properties": kinds,
                "additionalProperties": False,
                "minProperties": 1,
                "maxProperties": 1,
            },
        ]
    }
