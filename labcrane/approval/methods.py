"""The Methods paragraph of a paper, from the lock alone."""

from collections.abc import Mapping
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
    return [
        f"Task {name} was {_use(task)} ({_listed(task, units)})"
        if len(task) > 1
        else f"Task {name} was {_use(task)}"
        for name, task in protocol["tasks"].items()
    ]


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
        said.append(f"{words} consisted of {', '.join(map(_step, session['steps']))}")
    return said


def _step(step: str | Mapping[str, Any]) -> str:
    if isinstance(step, str):
        return step
    ((kind, value),) = step.items()
    if not isinstance(value, Mapping):
        return f"{kind} ({value})"
    name = value.get("name") or value.get("task")
    times = value.get("repeat", 1)
    if place := value.get("condition"):
        name = f"{name} (the participant's condition {place})"
    label = f"{kind} {name}" if name else f"{kind} ({_listed(value)})"
    return f"{times} times {label}" if times > 1 else label


def _use(component: Mapping[str, Any]) -> str:
    return str(component["use"]).replace("_", " ")


def _listed(settings: Mapping[str, Any], units: Mapping[str, str] | None = None) -> str:
    said = [_setting(name, value, units or {}) for name, value in settings.items() if name != "use"]
    return "; ".join(said)


def _setting(name: str, value: Any, units: Mapping[str, str]) -> str:
    """Return a setting in words; a unit at the end of its name goes behind the value."""
    words, _, ending = name.rpartition("_")
    unit = UNITS.get(ending, "")
    if not unit:
        words, unit = name, units.get(name, "")
    numbers = value if isinstance(value, list) else [value]
    if not all(type(number) in {int, float} for number in numbers):
        unit = ""  # written with its own, or no number
    return f"{words.replace('_', ' ')}: {_value(value)}{f' {unit}' if unit else ''}"


def _value(value: Any) -> str:
    if isinstance(value, list):
        return " and ".join(map(_value, value)) if len(value) < 3 else ", ".join(map(_value, value))  # noqa: PLR2004 - a list of two is read aloud with "and"
    return _number(value) if isinstance(value, float) else str(value)


def _number(value: float) -> str:
    return f"{value:g}"
