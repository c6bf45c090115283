"""The JSON Schema of a protocol, with the settings of everything that is installed, for editors."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from pydantic.json_schema import models_json_schema

from labcrane.core.roles import Component
from labcrane.core.settings import Settings
from labcrane.files.model import UNIT
from labcrane.files.units import KINDS, SPELT
from labcrane.machines.library import machine_names
from labcrane.protocol.protocol import ASSIST, OF_ASSIST, Assist, protocol_model
from labcrane.protocol.steps import Block, Break, Fixation, Session
from labcrane.registry.hookspecs import roles_by_key
from labcrane.registry.offers import Offer
from labcrane.registry.registry import Registry

Schema = dict[str, Any]


def protocol_schema(registry: Registry) -> Schema:
    """Return the JSON Schema (2020-12) of what a protocol may say with what is installed."""
    one, by_name = roles_by_key(several=False), roles_by_key(several=True)
    roles = [*one.values(), *by_name.values()]
    settings = {
        offer.settings: None
        for group in roles
        for role in group
        for offer in registry.offers[role].values()
    }
    model = protocol_model()
    models: list[type[Settings]] = [model, Assist, Session, Block, Break, Fixation, *settings]
    references, whole = models_json_schema([(each, "validation") for each in models])
    shared: Schema = whole["$defs"]
    named = {each: shared[ref["$ref"].split("/")[-1]] for (each, _), ref in references.items()}

    protocol = named[model]
    own = {key: named[Assist]["properties"][key] for key in OF_ASSIST}
    for key, of in one.items():
        protocol["properties"][key] = _use(registry, of, named, own if key == ASSIST else {})
    protocol["properties"][ASSIST]["required"].append("share")
    for key, of in by_name.items():
        place = protocol["properties"][key]
        for part in (place, *place.get("anyOf", ())):  # null may select a default
            if part.get("type") == "object":
                part |= {"additionalProperties": _use(registry, of, named)}
    protocol["properties"]["machine"]["anyOf"] = [
        {"enum": machine_names()},
        {"type": "string", "pattern": r"\.ya?ml$"},
    ]
    named[Session]["properties"]["steps"]["items"] = _step(references[(Block, "validation")])
    made: Schema = _with_units(
        {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            **protocol,
            "title": "A labcrane protocol",
            "$defs": shared,
        }
    )
    return made


def _with_units(schema: Any) -> Any:
    """Return a schema in which every number that has a unit may be written with another."""
    if isinstance(schema, list):
        return [_with_units(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    inside = {key: _with_units(value) for key, value in schema.items()}
    unit = inside.pop(UNIT, None)
    if unit is None:
        return inside
    said = {key: inside.pop(key) for key in ABOUT if key in inside}
    words = str(said.get("description", "")).strip()
    said["description"] = f"{words} Plain numbers are in {unit}; {KINDS[unit][1]} is fine, too."
    default = said.get("default")
    example = KINDS[unit][1]
    shown = [example] * len(default) if isinstance(default, list) else example
    said["examples"] = [shown] if default is None else [default, shown]
    return {**said, **_or_quantity(inside)}


NUMBERS = {"number", "integer"}

ABOUT = ("title", "description", "default", "examples")
"""Fields of a schema that describe a key as a whole."""


def _or_quantity(schema: Schema) -> Schema:
    """Return a schema of numbers, or lists of them, each of which may be a quantity."""
    if schema.get("type") in NUMBERS:
        return {**schema, "type": [schema["type"], "string"], "pattern": SPELT}
    made = dict(schema)
    if "anyOf" in made:
        made["anyOf"] = [_or_quantity(each) for each in made["anyOf"]]
    if isinstance(made.get("items"), dict):
        made["items"] = _or_quantity(made["items"])
    if "prefixItems" in made:
        made["prefixItems"] = [_or_quantity(each) for each in made["prefixItems"]]
    return made


def _use(
    registry: Registry,
    roles: tuple[type[Component], ...],
    named: Mapping[Any, Schema],
    own: Schema | None = None,
) -> Schema:
    """Return the schema of ``{use: NAME, ...}``; the name decides which other keys there are.

    Those that are the protocol's ``own`` are beside them.
    """
    offers = {name: each for role in roles for name, each in registry.offers[role].items()}
    return {
        "type": "object",
        "required": ["use"],
        "properties": {"use": {"enum": sorted(offers)}},
        "allOf": [
            {
                "if": {"properties": {"use": {"const": name}}, "required": ["use"]},
                "then": _with_use(offer, named, own or {}),
            }
            for name, offer in sorted(offers.items())
        ],
    }


def _with_use(offer: Offer[Component], named: Mapping[Any, Schema], own: Schema) -> Schema:
    model = deepcopy(named[offer.settings])
    model["properties"] = {"use": {"const": offer.name}, **own, **model.get("properties", {})}
    return model


def _step(block: Schema) -> Schema:
    """Return the schema of a step in the form in which it is written, one key and its value."""
    name: Schema = {"type": "string"}
    kinds: dict[str, Schema] = {
        "instructions": {**name, "description": "A text file in the protocol's folder."},
        "questionnaire": {"anyOf": [name, {"type": "array", "items": name, "minItems": 1}]},
        "practice": block,
        "reference": block,
        "block": block,
        "break": {"$ref": "#/$defs/Break"},
        "fixation": {"$ref": "#/$defs/Fixation"},
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
