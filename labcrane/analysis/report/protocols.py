"""Protocols of a cohort: differences between those of its sessions.

A study is amended, or a file is changed between two participants. Their sessions then differ, and
readers of averages need to know where.
"""

from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Cohort
from labcrane.analysis.report.sample import counted
from labcrane.files.yaml import parse_yaml

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("place", "value", "n", "sessions")

ASIDE = ("title", "participants", "expected", "page", "operator")
"""Keys of a protocol that do not affect participants."""

ABSENT = "(nothing)"

Leaves = dict[str, str]


def unlike_protocols(cohort: Cohort) -> "pd.DataFrame":
    """Return the differences of protocol, machine or files between the included sessions.

    Returns
    -------
    DataFrame
        One row for each value at each place: ``place`` (``scheme.map.slew``), ``value`` as written,
        ``n`` sessions, and ``sessions`` by name. Nothing where all are alike.
    """
    import pandas as pd

    versions: dict[tuple[object, ...], Leaves] = {}
    runs: list[
        tuple[str, tuple[object, ...]]
    ] = []  # of each session: its name, and the version that it has
    several = any(len(person.usable) > 1 for person in cohort.included)
    for person in cohort.included:
        for number, session in person.sessions():
            version = _key(session.context)
            if version not in versions:
                versions[version] = _leaves_of(session.context)
            runs.append((f"{person.name} session {number}" if several else person.name, version))
    rows = []
    for place in dict.fromkeys(place for leaves in versions.values() for place in leaves):
        held: dict[str, list[str]] = {}
        for name, key in runs:
            held.setdefault(versions[key].get(place, ABSENT), []).append(name)
        if len(held) > 1:
            rows += [(place, value, len(who), ", ".join(who)) for value, who in held.items()]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def in_words(unlike: "pd.DataFrame") -> str:
    """Return the first of the places in a sentence, and where the others are."""
    if not len(unlike):
        return "All sessions were run by the same protocol."
    places = unlike["place"].unique()
    first = unlike[unlike["place"] == places[0]]
    values = " and ".join(
        f"{value} in {counted(count, 'session')}"
        for value, count in zip(first["value"], first["n"], strict=True)
    )
    more = len(places) - 1
    others = f", and {counted(more, 'more place')}" if more else ""
    return (
        f"Not all sessions were run by the same protocol: {places[0]} was {values}{others}; the "
        "table of protocols says who had which. The averages are over all of them."
    )


def _key(context: Mapping[str, Any]) -> tuple[object, ...]:
    """Return all that :func:`_leaves_of` follows from, not yet parsed."""
    return context.get("protocol"), context.get("machine"), *_files(context), _version(context)


def _leaves_of(context: Mapping[str, Any]) -> Leaves:
    """Return all values of a session that may differ from another's, by their place."""
    protocol = parse_yaml(str(context.get("protocol", "")), "the recorded protocol", recorded=True)
    written = protocol if isinstance(protocol, Mapping) else {}
    found = dict(_leaves("", {key: each for key, each in written.items() if key not in ASIDE}))
    machine = str(context.get("machine", ""))
    found["content of the machine"] = _short(sha256(machine.encode()).hexdigest())
    found |= {f"content of {name}": _short(digest) for name, digest in _files(context)}
    found["version of labcrane"] = _version(context)
    return found


def _leaves(place: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield the innermost values of a tree with their places, items counted from 1."""
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _leaves(f"{place}.{key}" if place else str(key), inner)
    elif isinstance(value, Sequence) and not isinstance(value, str) and value:
        for number, inner in enumerate(value, start=1):
            yield from _leaves(f"{place}[{number}]", inner)
    else:
        yield place, str(value)


def _files(context: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name, file in context.get("files", {}).items():
        yield str(name), str(file["sha256"])
    for name, text in context.get("own_plugins", {}).items():
        yield f"plugin {name}", sha256(str(text).encode()).hexdigest()


def _version(context: Mapping[str, Any]) -> str:
    return str(context.get("versions", {}).get("labcrane", ""))


def _short(digest: str) -> str:
    return f"sha256 {digest[:8]}"
