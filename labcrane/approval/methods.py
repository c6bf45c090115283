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
        f"The study “{lock.content['title']}” {_approved(lock)}",
        *_people(protocol),
        f"Participants operated the {lock.content['machine_title']} "
        f"({_use(protocol['dynamics'])}) with the input {_use(protocol['input'])} under the "
        f"scheme {_use(protocol['scheme'])}",
        *_assistant(protocol),
        f"The simulation ran at {_number(protocol.get('rate_hz', 240))} Hz, and every tick was "
        "recorded",
        *_parts(protocol, lock.content.get("settings", {})),
        *_stop_rules(protocol),
        *_primary(protocol),
        *_design(protocol),
        *_sessions(protocol),
        f"The software was labcrane {materials['labcrane']['version']} with the plug-ins "
        + ", ".join(f"{name} {plugin['version']}" for name, plugin in materials["plugins"].items())
        + f"; protocol, materials and source {_fixed(lock)} (SHA-256 {lock.materials_sha256})",
    ]
    return ". ".join(sentences) + ".\n"


def _approved(lock: Lock) -> str:
    if "approval" not in lock.content:
        return "is planned, and not approved yet"
    return (
        f"was approved by {lock.approval['board']} (reference {lock.approval['reference']}, valid "
        f"until {lock.approval['valid_until']}){_amended(lock)}"
    )


def _fixed(lock: Lock) -> str:
    return "were locked" if "approval" in lock.content else "are not locked yet"


def _amended(lock: Lock) -> str:
    if not lock.amendments:
        return ""
    listed = ", ".join(
        f"{entry['reference']} on {entry['date']} ({entry['why']})" for entry in lock.amendments
    )
    return f" and amended: {listed}"


def _assistant(protocol: Mapping[str, Any]) -> list[str]:
    if not (assist := protocol.get("assist")):
        return []
    share = assist["share"]
    words = "a share" if isinstance(share, Mapping) else f"a share of {_value(share)}"
    if _follows(share):
        (first, last), (low, high) = share["between"], share["to"]
        words = f"a share that followed the estimate {share['estimate']} ({_value(low)} at "
        words += f"{_value(first)}, {_value(high)} at {_value(last)}, changed by at most "
        words += f"{_value(share['at_most_per_s'])} per second)"
    said = f"An assistant ({_use(assist)}) moved the machine together with them: the command of "
    said += f"each joint was a weighted mean of both, with {words} of the assistant"
    if takeover := assist.get("takeover"):
        said += f", and the participant's alone while {takeover} was pressed"
    return [said]


def _people(protocol: Mapping[str, Any]) -> list[str]:
    planned = protocol.get("participants", {}).get("planned", 1)
    said = [f"It was planned with {planned} participant{'s' * (planned != 1)}, under pseudonyms"]
    if groups := protocol.get("design", {}).get("groups"):
        listed = "; ".join(
            f"{name} {_given(list(given), protocol)}" for name, given in groups.items()
        )
        said.append(
            f"They were allocated to {len(groups)} groups ({listed}) in permuted blocks of "
            f"{len(groups)}"
        )
    return said


def _parts(protocol: Mapping[str, Any], settings: Mapping[str, Any]) -> list[str]:
    """Return tasks, estimates and feedback with the protocol's words for each.

    All but feedback has its other settings, too: rules of onset and end are among them. An early
    lock has neither units nor the others.
    """
    said = []
    for kind, plural in (("task", "tasks"), ("estimate", "estimates"), ("feedback", "feedback")):
        for name, given in protocol.get(plural, {}).items():
            of_it = settings.get(f"{plural}.{name}", {})
            units = {key: each["unit"] for key, each in of_it.items()}
            words = f"these settings: {_listed(given, units)}" if len(given) > 1 else ""
            said.append(f"The {kind} {_named(name, given)} had {words or 'default settings'}")
            others = {
                key: each["value"]
                for key, each in of_it.items()
                if not each["written"] and each["value"] not in (None, "", [], {})
            }
            if kind != "feedback" and others:
                said[-1] += f"; by default: {_listed(others, units)}"
    return said


def _stop_rules(protocol: Mapping[str, Any]) -> list[str]:
    said = []
    for rule in protocol.get("stop_rules", []):
        what = f"the mean of the estimate {rule.get('estimate')} over a trial"
        if "questionnaire" in rule:
            what = f"the {_value(rule['score'])} of the questionnaire "
            what += _value(rule["questionnaire"])
        limit = _listed({key: rule[key] for key in ("above", "below") if key in rule})
        said.append(f"{what} was {limit}")
    if not said:
        return []
    return [f"The session paused for a decision of the experimenter when {' or '.join(said)}"]


def _primary(protocol: Mapping[str, Any]) -> list[str]:
    names = [name.replace("_", " ") for name in protocol.get("design", {}).get("primary", [])]
    return (
        [f"The primary outcome{'s were' * (len(names) > 1) or ' was'} {_and(names)}"]
        if names
        else []
    )


def _named(name: str, task: Mapping[str, Any]) -> str:
    words = name.replace("_", " ")
    return words if words == _use(task) else f"{words} ({_use(task)})"


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
        listed = "; ".join(
            f"{name} {_given(given, protocol)}" for name, given in conditions.items()
        )
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


def _given(given: str | list[str], protocol: Mapping[str, Any]) -> str:
    """Return what is on in words: ``with the feedback ball and an assistant's share of 0.5``."""
    shares = _shares(protocol)
    if given == "group":
        return "with the feedback of the group"
    if given == "all":
        given = [*protocol.get("feedback", {}), *shares]
        if not shares:
            return "with all feedback"
    names = [] if given == "none" else list(given)
    cues = [name for name in names if name not in shares]
    words = [f"with the feedback {_value(cues)}" if cues else "without feedback"]
    if shares:
        size = next((shares[name] for name in names if name in shares), 0.0)
        helped = f"with an assistant's share of {_value(size)}" if size else "without assistance"
        words = [*words, helped] if protocol.get("feedback") else [helped]
    return " and ".join(words)


def _shares(protocol: Mapping[str, Any]) -> Mapping[str, float]:
    """Return the shares of an assistant that have names."""
    share = protocol.get("assist", {}).get("share")
    return share if isinstance(share, Mapping) and not _follows(share) else {}


def _follows(share: object) -> bool:
    """Whether a share follows an estimate."""
    return isinstance(share, Mapping) and isinstance(share.get("estimate"), str)


def _sessions(protocol: Mapping[str, Any]) -> list[str]:
    said = []
    for number, session in enumerate(protocol["sessions"], start=1):
        words = f"Session {number} ({session['name']})"
        if days := session.get("after_days"):
            words += f", {days[0]} to {days[1]} days after the one before,"
        steps = [_step(step, protocol) for step in session["steps"]]
        said.append(f"{words} consisted of {_and(steps)}")
    return said


def _step(step: str | Mapping[str, Any], protocol: Mapping[str, Any]) -> str:
    """Return a step; one of trials with what is on, in a study that has feedback or shares."""
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
    name, task = value.get("name"), value.get("task")
    name = f"{name} ({task})" if name and task and name != task else name or task
    times = value.get("repeat", 1)
    if place := value.get("condition"):
        name = f"{name} (the participant's condition {place})"
    elif task and (protocol.get("feedback") or _shares(protocol)):
        name = f"{name} {_given(value.get('feedback', 'all'), protocol)}"
        if shares := value.get("fading"):
            name = f"{name} in shares of {_value(shares)} of the trials of successive parts"
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
    if isinstance(value, str) and value.isidentifier():
        return value.replace("_", " ")
    return _number(value) if isinstance(value, float) else str(value)


def _number(value: float) -> str:
    return f"{value:g}"
