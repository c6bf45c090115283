"""The Methods paragraph of a paper, from the lock alone."""

from collections.abc import Iterable, Mapping
from typing import Any

from labcrane.approval.lock import Lock
from labcrane.design.order import SQUARES


def methods(lock: Lock) -> str:
    """Return the paragraph, as Markdown."""
    materials = lock.content["materials"]
    protocol: Mapping[str, Any] = materials["protocol"]
    sentences = [
        f"The study “{lock.content['title']}” was approved by {lock.approval['board']} "
        f"(reference {lock.approval['reference']}, valid until {lock.approval['valid_until']})"
        + _amended(lock),
        *_people(protocol),
        f"Participants operated the {lock.content['machine_title']} "
        f"({_use(protocol['dynamics'])}) with the input {_use(protocol['input'])} under the "
        f"scheme {_use(protocol['scheme'])}",
        f"The simulation ran at {_number(protocol.get('rate_hz', 240))} Hz, and every tick was "
        "recorded",
        *_tasks(protocol, _units(lock)),
        *_design(protocol),
        *_sessions(protocol),
        f"The software was labcrane {materials['labcrane']['version']} with the plug-ins "
        + ", ".join(f"{name} {plugin['version']}" for name, plugin in materials["plugins"].items())
        + f"; protocol, materials and source were locked (SHA-256 {lock.materials_sha256})",
    ]
    return ". ".join(sentences) + ".\n"


def _amended(lock: Lock) -> str:
    if not lock.amendments:
        return ""
    listed = ", ".join(
        f"{entry['reference']} on {entry['date']} ({entry['why']})" for entry in lock.amendments
    )
    return f" and amended: {listed}"


def _people(protocol: Mapping[str, Any]) -> list[str]:
    planned = protocol.get("participants", {}).get("planned", 1)
    said = [f"It was planned with {planned} participant{'s' * (planned != 1)}, under pseudonyms"]
    if groups := protocol.get("design", {}).get("groups"):
        said.append(
            f"They were allocated to {len(groups)} groups ({', '.join(groups)}) in permuted "
            f"blocks of {len(groups)}"
        )
    return said


def _tasks(protocol: Mapping[str, Any], units: Mapping[str, str]) -> list[str]:
    said = []
    for name, task in protocol["tasks"].items():
        words = name.replace("_", " ")
        kind = "" if words == _use(task) else f" ({_use(task)})"
        given = f"these settings: {_listed(task, units)}" if len(task) > 1 else "default settings"
        said.append(f"The task {words}{kind} had {given}")
    return said


def _units(lock: Lock) -> dict[str, str]:
    """Return the units of the columns of trials, which tasks call as the settings that they vary.

    A setting of several, such as ``distances``, has the unit of the column ``distance``.
    """
    rows = [row for row in lock.content["codebook"] if row["table"] == "trials"]
    named = {row["name"]: row["unit"] for row in rows if row["unit"] not in {"", "1"}}
    return {**{f"{name}s": unit for name, unit in named.items()}, **named}


UNITS = {"s": "s", "hz": "Hz", "m": "m", "deg": "degrees"}
"""Units at the end of a setting's name."""

ORDERS = {
    "as_written": "in a fixed order",
    "shuffled": "in a completely randomised order",
    "blocked": "in randomised blocks",
    "latin_square": "in the orders of a Latin square",
    "williams": "in the orders of a Williams design, balanced for first-order carry-over",
}


def _design(protocol: Mapping[str, Any]) -> list[str]:
    said = []
    design = protocol.get("design", {})
    conditions, orders = design.get("conditions", {}), design.get("order", {})
    if conditions:
        listed = "; ".join(f"{name} {_given(given)}" for name, given in conditions.items())
        said.append(f"Every participant had {len(conditions)} conditions ({listed})")
        orders = {"condition": "as_written", **orders}
    for factor, order in orders.items():
        rule: Mapping[str, Any] = {"rule": order} if isinstance(order, str) else order
        words = f"The levels of {factor} came {ORDERS[rule['rule']]}"
        if factor == "condition" and conditions and rule["rule"] in SQUARES:
            words += ", assigned to participants at random"
        if rule.get("times", 1) > 1:
            words += f", {rule['times']} times each"
        if rule.get("in_a_row"):
            words += f", no more than {rule['in_a_row']} in a row"
        said.append(words)
    return said


def _given(feedback: str | list[str]) -> str:
    """Return a condition's feedback in words: ``with the feedback ball and tone``."""
    if feedback in ("none", []):
        return "without feedback"
    if feedback in ("all", "group"):
        return "with all feedback" if feedback == "all" else "with the feedback of the group"
    return f"with the feedback {_value(feedback)}"


def _sessions(protocol: Mapping[str, Any]) -> list[str]:
    said = []
    for number, session in enumerate(protocol["sessions"], start=1):
        words = f"Session {number} ({session['name']})"
        if days := session.get("after_days"):
            words += f", {days[0]} to {days[1]} days after the one before,"
        said.append(f"{words} consisted of {_and(map(_step, session['steps']))}")
    return said


def _step(step: str | Mapping[str, Any]) -> str:
    if isinstance(step, str):
        return step
    ((kind, value),) = step.items()
    if kind == "questionnaire":
        names = [value] if isinstance(value, str) else value
        return f"the questionnaire{'s' * (len(names) > 1)} {_and(names)}"
    if not isinstance(value, Mapping):
        return f"{kind} ({_value(value)})"
    if kind == "break":
        return f"a break of {_with_unit(value['seconds'], 's')}"
    name = value.get("name") or value.get("task")
    times = value.get("repeat", 1)
    if place := value.get("condition"):
        name = f"{name} (the participant's condition {place})"
    label = f"the {kind} {name}" if name else f"{kind} ({_listed(value)})"
    return f"{times} times {label}" if times > 1 else label


def _use(component: Mapping[str, Any]) -> str:
    return str(component["use"]).replace("_", " ")


def _listed(settings: Mapping[str, Any], units: Mapping[str, str] | None = None) -> str:
    said = [_setting(name, value, units or {}) for name, value in settings.items() if name != "use"]
    return "; ".join(said)


def _setting(name: str, value: Any, units: Mapping[str, str]) -> str:
    """Return a setting in words; a unit at the end of its name goes behind the value."""
    if name == "seconds":
        return _with_unit(value, "s")
    words, _, ending = name.rpartition("_")
    unit = UNITS.get(ending, "")
    if not unit:
        words, unit = name, units.get(name, "")
    return f"{words.replace('_', ' ')} {_with_unit(value, unit)}"


def _with_unit(value: Any, unit: str) -> str:
    """Return a value with its unit, unless it is written with its own, or is not a number."""
    numbers = value if isinstance(value, list) else [value]
    if not unit or not all(type(number) in {int, float} for number in numbers):
        return _value(value)
    return f"{_value(value)} {unit}"


def _and(words: Iterable[str]) -> str:
    """Return words as they are read aloud: ``a, b and c``."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def _value(value: Any) -> str:
    if isinstance(value, list):
        return _and(map(_value, value)) if value else "none"
    if isinstance(value, Mapping):
        return ", ".join(
            f"{str(name).replace('_', ' ')} {_value(of)}" for name, of in value.items()
        )
    return _number(value) if isinstance(value, float) else str(value)


def _number(value: float) -> str:
    return f"{value:g}"
