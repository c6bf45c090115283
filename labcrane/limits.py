"""Limits of everything that enters from outside: one table, and the checks that keep to it.

Limits are enforced in the sender's process, before the input reaches a pipe or the loop. The time
of every check grows at most linearly with its input. docs/reference/input-limits.md prints the
table; a test compares the two.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


class LimitError(ValueError):
    """An input from outside is too large, nested too deep, or contains a refused character."""


@dataclass(frozen=True, slots=True)
class Limit:
    """The limits of one kind of input.

    Attributes
    ----------
    most, unit
        Its size.
    depth
        How deep lists and mappings in it may be nested; 0 where nothing can be.
    alphabet
        The allowed characters or content, in words.
    door
        The module that checks it, in the sender's process.
    otherwise
        What happens to refused input.
    """

    most: int
    unit: str
    depth: int
    alphabet: str
    door: str
    otherwise: str


TEXT = "Unicode without control characters, halves of surrogates and marks that turn the direction"
EVENT = "refused with an event; the session goes on"
ERROR = "an error with file, line and what to do"
HELD = "the session ends with an error that says how many frames could not be written"
LOST = "the input is lost: command to zero, pause, event; back with the next good value"

LIMITS: Mapping[str, Limit] = {
    "answer": Limit(8_000, "characters", 4, f"JSON of {TEXT}", "web.page, session.commands", EVENT),
    "note": Limit(4_000, "characters", 0, TEXT, "web.page, session.commands", EVENT),
    "hint": Limit(500, "characters", 0, TEXT, "web.page, session.commands", EVENT),
    "setting": Limit(
        200, "characters", 0, "one line without YAML's marks", "web.page, session.commands", EVENT
    ),
    "order": Limit(200, "characters", 0, TEXT, "web.page, session.commands", EVENT),
    "message to a session": Limit(
        65_536,
        "bytes",
        0,
        "JSON of a known kind",
        "session.commands",
        "refused by its sender, and reported",
    ),
    "frames waiting for a disk": Limit(
        200_000_000, "bytes", 0, "frames and events", "recording.frame_log", HELD
    ),
    "signals waiting for monitors": Limit(
        64_000_000,
        "bytes",
        0,
        "samples",
        "streams.recorder.signal_feed",
        "monitors look at the next ones; the record has all",
    ),
    "request body": Limit(
        32_000, "bytes", 0, "any", "web.server.guard", "status 413 before it is buffered"
    ),
    "message of a page": Limit(
        64_000, "bytes", 0, "any", "web.server.guard", "the socket is closed with 1009"
    ),
    "requests of one address": Limit(
        200, "requests a second", 0, "any", "web.server.guard", "status 429; one event a second"
    ),
    "page loads of one address": Limit(
        5,
        "loads a second, 30 at once",
        0,
        "any",
        "web.server.guard",
        "status 429; one event a second",
    ),
    "orders of one page": Limit(
        20, "orders a second", 0, "any", "web.page", "refused; one event a second"
    ),
    "sockets": Limit(100, "connections", 0, "any", "web.service", "status 503"),
    "CAN frame": Limit(
        4_000, "frames a second", 0, "finite signals within full flow", "labcrane_can", LOST
    ),
    "gateway sample": Limit(
        64, "samples a tick", 0, "finite numbers, -250 to 250", "labcrane_gateway", LOST
    ),
    "key sample": Limit(
        64, "samples a tick", 0, "finite numbers, 0 to 1", "labcrane_keyboard", LOST
    ),
    "trigger echo": Limit(
        32,
        "codes a tick",
        0,
        "bytes; at most 20 a second that were not sent",
        "streams.triggers, labcrane_ttl",
        "left out and counted; one event a second says how many",
    ),
    "stream header": Limit(
        1_000_000, "characters", 32, "XML without a document type", "recording.xdf.header", ERROR
    ),
    "stream channels": Limit(
        4_096, "channels", 0, "a format of XDF, a finite rate", "recording.xdf.header", ERROR
    ),
    "YAML file": Limit(
        256_000,
        "bytes",
        50,
        "UTF-8; 20,000 marks, 50,000 values after aliases",
        "files.yaml",
        ERROR,
    ),
    "DBC file": Limit(1_000_000, "bytes", 0, "a DBC file", "labcrane_can", ERROR),
    "CSV table": Limit(
        50_000_000,
        "bytes",
        0,
        "UTF-8 without NUL, gzipped or not; the bytes are those unpacked",
        "files.table",
        ERROR,
    ),
    "mesh": Limit(100_000_000, "bytes", 0, "STL or OBJ", "machines.meshes.reader", ERROR),
    "triangles of a mesh": Limit(
        2_000_000,
        "triangles",
        0,
        "finite points, corners that are there",
        "machines.meshes.surface",
        ERROR,
    ),
    "robot description": Limit(
        5_000_000,
        "bytes",
        100,
        "URDF without a document type; 20,000 elements",
        "machines.descriptions.robot_xml",
        ERROR,
    ),
    "participant file": Limit(
        5_000_000, "values a column", 0, "HDF5 without links and data outside", "recording", ERROR
    ),
}
"""By kind of input."""

# Every character that a page, a terminal, XML or JSON may show wrongly: control characters except
# tab and line ends, halves of surrogates, noncharacters, and marks that turn the direction.
_FOREIGN = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
# A setting is one plain value: no anchors, tags, lists, mappings, block texts or further documents.
_SETTING = re.compile(r"[&*!|>%@`\[\]{}#\n\r\t]")


def check_size(size: int, kind: str, what: str = "") -> None:
    """Raise :class:`LimitError` where ``size`` is more than a ``kind`` of input may have."""
    limit = LIMITS[kind]
    if size > limit.most:
        raise LimitError(
            f"{what or f'a {kind}'} has {size} {limit.unit}; the maximum is {limit.most}"
        )


def check_text(text: str, kind: str) -> None:
    """Raise :class:`LimitError` where ``text`` may not enter as this ``kind`` of input."""
    check_size(len(text), kind, f"the {kind}")
    if (sign := foreign(text)) is not None:
        raise LimitError(
            f"the {kind} contains the character U+{ord(sign):04X}, which is not allowed; remove it"
        )
    if kind == "setting" and (found := _SETTING.search(text)):
        raise LimitError(
            f"the setting contains {found[0]!r}; write one plain value in one line: name.key=value"
        )


def foreign(text: str) -> str | None:
    """Return the first character in ``text`` that is not allowed; None if all are."""
    found = _FOREIGN.search(text)
    return found[0] if found else None


def read_json(text: str, kind: str) -> Any:
    """Return the content of a JSON text.

    Raises
    ------
    LimitError
        It is too long, nested too deep, contains a refused character, or is not valid JSON.
    """
    check_text(text, kind)
    most = LIMITS[kind].depth
    # A text with so few brackets cannot be nested deeper: the loop can be skipped.
    if text.count("[") + text.count("{") > most and _deepest(text) > most:
        raise LimitError(f"the {kind} is nested deeper than {most} levels; write it flat")
    try:
        # Whole numbers as floats: Python refuses more than 4,300 digits.
        return json.loads(text, parse_int=_number)
    except (ValueError, RecursionError) as error:
        raise LimitError(f"the {kind} is not valid JSON: {error}") from error


def _number(digits: str) -> float | int:
    """Return a whole number; as a float when it has 20 digits or more."""
    return int(digits) if len(digits) < 20 else float(digits)  # noqa: PLR2004 - 64 bits


def _deepest(text: str) -> int:
    depth = deepest = 0
    inside = escaped = False
    for sign in text:
        if inside:
            if escaped:
                escaped = False
            elif sign == "\\":
                escaped = True
            else:
                inside = sign != '"'
        elif sign == '"':
            inside = True
        elif sign in "[{":
            depth += 1
            deepest = max(deepest, depth)
        elif sign in "]}":
            depth -= 1
    return deepest
