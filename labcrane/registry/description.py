"""Description of an offer before it is used: settings, signals, an example."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from labcrane.core.roles import Component, Questionnaire, Task
from labcrane.errors import LabcraneError
from labcrane.machines.machine import Machine
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.offers import Offer
from labcrane.registry.registry import Registry


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting.

    Attributes
    ----------
    possible
        Which values it takes, in words.
    default
        As a protocol would write it; None when it must be given.
    meaning
        What its docstring says, with the unit.
    """

    name: str
    possible: str
    default: str | None
    meaning: str


@dataclass(frozen=True, slots=True)
class Recorded:
    """A column that it fills."""

    column: str
    unit: str
    where: str
    definition: str = ""


@dataclass(frozen=True, slots=True)
class OfferSheet:
    """An offer, described.

    Attributes
    ----------
    about
        What its settings' docstring says first.
    recorded
        What it records with its default settings; None when it cannot be built without knowing
        more.
    example
        How a protocol uses it, with every setting at its default.
    """

    role: str
    name: str
    plugin: str
    about: str
    settings: tuple[Setting, ...]
    recorded: tuple[Recorded, ...] | None
    example: str

    def as_json(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return asdict(self)


def sheets(registry: Registry, name: str, machine: Machine) -> list[OfferSheet]:
    """Return everything that is called ``name``, in any role; ``machine`` is only an example."""
    return [
        _sheet(role, offers[name], registry.plugins[role][name], machine)
        for role, offers in registry.offers.items()
        if name in offers
    ]


def _sheet(
    role: type[Component], offer: Offer[Component], plugin: str, machine: Machine
) -> OfferSheet:
    schema = offer.settings.model_json_schema()
    fields = offer.settings.model_fields
    settings = tuple(
        Setting(
            name,
            possible(written, schema.get("$defs", {})),
            None if fields[name].is_required() else _default(fields[name]),
            " ".join(written.get("description", "").split()),
        )
        for name, written in schema.get("properties", {}).items()
    )
    about = " ".join((offer.settings.__doc__ or "").split("\n\n")[0].split())
    return OfferSheet(
        ROLES[role].word,
        offer.name,
        plugin,
        about,
        settings,
        _recorded(role, offer, machine),
        _example(role, offer.name, settings),
    )


def _default(field: FieldInfo) -> str:
    value = field.get_default(call_default_factory=True)
    plain = value.model_dump(mode="json") if hasattr(value, "model_dump") else value
    if isinstance(plain, str) and plain not in {"", "true", "false", "null"}:
        return plain  # as YAML takes it
    return json.dumps(plain, default=str, ensure_ascii=False)


BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at least",
    "exclusiveMaximum": "below",
    "maximum": "at most",
}


def possible(schema: Mapping[str, Any], shared: Mapping[str, Any]) -> str:
    """Return in words what a JSON Schema admits."""
    if "$ref" in schema:
        return possible(shared[schema["$ref"].split("/")[-1]], shared)
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(possible(each, shared) for each in choices))
    if "const" in schema:
        return str(schema["const"])
    if "enum" in schema:
        return ", ".join(map(str, schema["enum"]))
    kind = {"null": "none", "string": "text", "integer": "whole number", "object": "mapping"}.get(
        schema.get("type", "anything"), schema.get("type", "anything")
    )
    if kind == "array":
        each = schema.get("prefixItems")
        inner = ", ".join(possible(item, shared) for item in each or [schema.get("items", {})])
        return f"[{inner}]" if each else f"list of {inner}"
    bounds = [f"{word} {schema[key]:g}" for key, word in BOUNDS.items() if key in schema]
    return " ".join([kind, " and ".join(bounds)]).strip()


def _recorded(
    role: type[Component], offer: Offer[Component], machine: Machine
) -> tuple[Recorded, ...] | None:
    try:
        component = offer.build(offer.settings(), machine)
    except (ValidationError, LabcraneError):
        return None
    found = [(ROLES[role].recorded, signal) for signal in component.signals]
    if isinstance(component, Task):
        found += [("every trial", signal) for signal in (*component.conditions, *component.results)]
    columns = [
        Recorded(column, signal.unit, where, signal.definition)
        for where, signal in found
        for column in signal.columns
    ]
    if isinstance(component, Questionnaire):
        columns += [Recorded(score.name, "1", "every time") for score in component.scores]
    return tuple(columns)


def _example(role: type[Component], name: str, settings: tuple[Setting, ...]) -> str:
    entry = ROLES[role]
    if not entry.keys:
        return f"labcrane export DATA --to {name} --out FOLDER"
    path = (entry.keys[0], name) if entry.several else entry.keys[:1]
    lines = [f"{'  ' * depth}{key}:" for depth, key in enumerate(path)]
    inner = "  " * len(lines)
    lines.append(f"{inner}use: {name}")
    for setting in settings:
        value = "..." if setting.default is None else setting.default
        lines.append(f"{inner}{setting.name}: {value}")
    return "\n".join(lines)
