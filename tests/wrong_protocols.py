"""Wrong protocols, made by walking what a right one says: one fault each, and the line it is in."""

import itertools
import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, SequenceNode

from labcrane.analysis.indicator_settings import IndicatorSettings
from labcrane.protocol.pages import PageSettings
from labcrane.protocol.protocol import OnFault, Participants
from labcrane.protocol.streams import StreamNeed, TimeLimits
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.registry import Registry

PROTOCOLS = Path(__file__).parents[1] / "protocols"

Place = tuple[str | int, ...]

SKELETON = """\
labcrane: 1
study: everything
title: Everything that a protocol can say
participants: {}
machine: ch8
input: {use: dual_joystick}
operator: {use: simulated_operator}
scheme:
  use: switchable
  button: left.trigger
  joint_velocity: {map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}}
  end_effector: {map: {x: left.x, y: left.y, z: right.y}}
dynamics: {use: kinematic_crane, actuator: {dead_time_s: 0.01, lag_s: 0.05, rate_limit: 4.0}}
tasks:
  near: {use: aiming, distances: [2, 3], movements: 1}
  far: {use: aiming, distances: [4, 6], movements: 1}
questionnaires:
  comfort:
    use: free
    title: Comfort
    questions:
      - {name: neck, text: How is your neck?, lowest: 0, highest: 10}
      - {name: words, text: Anything else?, kind: text, required: false}
    sums: {pain: [neck]}
stop_rules:
  - {questionnaire: comfort, score: pain, above: 8}
page: {}
feedback:
  ball: {use: sphere}
  tone: {use: sonification}
views:
  operator:
    use: view
    camera: {name: cab, eye: [-2.2, 2.2, 3.3], look: [5.2, 0.3, 0.8], on: slew}
    beside: [top]
    areas: [tip, target, slew, sphere]
    supervisor: {cameras: [cab, top]}
    patch: {on: [trial.start, target.entered]}
streams:
  brain: {type: EEG, source_id: cap-7, required: false}
monitors:
  brain: {use: eeg_signal}
sync: {}
indicator: {}
design:
  groups: {without: [], with: [ball, tone]}
  order: {pairs: {rule: shuffled, times: 1, in_a_row: 2}}
  primary: [movement_time, sparc]
sessions:
  - name: first
    steps:
      - consent
      - instructions: instructions.md
      - questionnaire: [comfort, subjective_accuracy]
      - practice: {task: near, pairs: 1, until: {successes: 1, rounds: 2}}
      - reference: {task: near, pairs: 1, feedback: none}
      - block: {task: near, pairs: 2, name: more, ask: [situational_awareness], feedback: group}
      - break: {seconds: 10}
  - name: second
    after_days: [1, 3]
    steps:
      - block: {task: far, pairs: 2, feedback: [ball], repeat: 2}
on_fault: {}
"""
"""What everything needs; every key with a default is written out beside it."""


def everything(registry: Registry) -> str:
    """Return a protocol that writes out every setting of what it uses."""
    data = YAML().load(SKELETON)
    for role, entry in ROLES.items():
        for key in entry.keys:
            uses = data.get(key) or {}
            for use in uses.values() if entry.several else [uses]:
                if isinstance(use, Mapping) and use["use"] in registry.offers[role]:
                    _fill(use, registry.offers[role][use["use"]].settings)
    for key, model in (
        ("participants", Participants),
        ("page", PageSettings),
        ("on_fault", OnFault),
        ("sync", TimeLimits),
        ("indicator", IndicatorSettings),
    ):
        _fill(data[key], model)
    _fill(data["streams"]["brain"], StreamNeed)
    out = StringIO()
    _yaml().dump(data, out)
    return out.getvalue()


def _fill(written: Any, model: Any) -> None:
    for name, field in model.model_fields.items():
        if name in written or field.is_required():
            continue
        value = field.get_default(call_default_factory=True)
        value = value.model_dump(mode="json") if hasattr(value, "model_dump") else value
        if value is None or (isinstance(value, (list, tuple, dict)) and not value):
            continue
        written[name] = list(value) if isinstance(value, tuple) else value


def _yaml() -> YAML:
    yaml = YAML()
    yaml.width = 10_000
    return yaml


@dataclass(frozen=True)
class Wrong:
    """A protocol with one fault.

    Attributes
    ----------
    study
        Which folder it belongs to.
    fault
        What was done to it, in words.
    place
        Where; empty for what is done to the text as a whole.
    text
        The file.
    line
        In which it is; 0 where the file as a whole is meant.
    columns
        Where in that line it may be pointed at: the key, or the value; empty where that is not
        known.
    must
        Whether it must be refused or questioned: it cannot be meant.
    """

    study: str
    fault: str
    place: Place
    text: bytes
    line: int
    must: bool
    columns: frozenset[int] = frozenset()

    def __str__(self) -> str:
        return f"{self.study} {'.'.join(map(str, self.place))}: {self.fault}"


FREE = {"title", "name", "text", "left", "right", "pattern", "language", "type", "source_id",
        "rights", "study", "host", "font", "stick", "bus", "colour"}  # fmt: skip
"""Keys whose text is a person's own, or may be spelt in more than one way."""

OF_LAB = {
    ("tasks",),
    ("questionnaires",),
    ("feedback",),
    ("views",),
    ("streams",),
    ("monitors",),
    ("design", "groups"),
}
"""Mappings whose keys are the study's own names."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A key with its value, or an item, and where it stands in the text.

    Attributes
    ----------
    line
        Of its key, or of the item.
    begin, key_end, start, end
        Where its key begins and ends, and its value; of an item both are the value's.
    left, right
        What is to be cut out to remove it.
    """

    place: Place
    value: Any
    line: int
    begin: int
    key_end: int
    start: int
    end: int
    left: int
    right: int


def entries(text: str) -> list[Entry]:
    """Return everything that a YAML text holds, with its place in the text."""
    return list(_inside(text, YAML(pure=True).compose(text), (), set()))


def _inside(text: str, node: Any, place: Place, seen: set[int]) -> Iterator[Entry]:
    if id(node) in seen or not isinstance(node, MappingNode | SequenceNode):
        return  # an alias, or a plain value
    seen.add(id(node))
    if isinstance(node, MappingNode):
        pairs = [(key.value, key, value) for key, value in node.value]
    else:
        pairs = [(at, each, each) for at, each in enumerate(node.value)]
    for at, (name, key, value) in enumerate(pairs):
        begin, right = key.start_mark.index, _end(text, value)
        left = begin
        if at + 1 < len(pairs):
            right = pairs[at + 1][1].start_mark.index
        elif at:
            left = _end(text, pairs[at - 1][2])
        start = value.start_mark.index
        if key is not value and "\n" in text[key.end_mark.index : start]:
            start = text.index(":", key.end_mark.index) + 1  # beside its key
        yield Entry(
            (*place, name), _plain(text, value), key.start_mark.line + 1, begin,
            key.end_mark.index, start, _end(text, value), left, right,
        )  # fmt: skip
        yield from _inside(text, value, (*place, name), seen)


def _end(text: str, node: Any) -> int:
    return len(text[: node.end_mark.index].rstrip())


def _plain(text: str, node: Any) -> Any:
    if isinstance(node, MappingNode):
        return {key.value: _plain(text, value) for key, value in node.value}
    if isinstance(node, SequenceNode):
        return [_plain(text, each) for each in node.value]
    return YAML(typ="safe").load(text[node.start_mark.index : node.end_mark.index])


def misspelt(rng: random.Random, word: str) -> str:
    """Return a word with one letter changed."""
    at = rng.choice([at for at, sign in enumerate(word) if sign.isalnum()] or [0])
    return word[:at] + rng.choice([sign for sign in "qzwy" if sign != word[at]]) + word[at + 1 :]


KINDS = ("5", "[1, 2]", "{a: 1}", "true", "null")
NUMBERS = {"-1": False, "0": False, "1e300": False, ".nan": True, ".inf": True, "-1.0e+9": False}
WORDS = {
    "much": True, "'1,5'": True, "50 candelas": True, "1:30": True, "[1]": True, "{a: 1}": True,
    "null": False, "true": True, "''": True, "no": True,
}  # fmt: skip
"""What a number may be written as by mistake, and whether it cannot be meant."""

OR_NAMES = {"screen", "screens"}
"""Keys whose numbers may be names as well: a screen is called HDMI-1."""

A_NAME = {"much", "'1,5'", "50 candelas", "1:30", "no"}


def faults(study: str, text: str, seed: int = 0) -> Iterator[Wrong]:
    """Yield every single fault of a protocol, with what is random in it drawn from ``seed``."""
    rng = random.Random(f"{study} {seed}")
    there = entries(text)
    line_at = {entry.place: entry.line for entry in there}
    at_place = {entry.place: entry for entry in there}
    for entry in there:
        last, holder = entry.place[-1], entry.place[:-1]
        if isinstance(last, str) and holder not in OF_LAB and holder[-1:] != ("sums",):
            new = misspelt(rng, last)
            changed = text[: entry.begin] + new + text[entry.key_end :]
            yield Wrong(
                study,
                f"key misspelt as {new}",
                entry.place,
                changed.encode(),
                entry.line,
                must=True,
                columns=frozenset({_column(text, entry.begin)}),
            )
        if isinstance(last, str) and (entry.left != entry.begin or entry.right != entry.end):
            cut = text[: entry.left] + text[entry.right :]
            line = line_at.get(holder, 1)
            yield Wrong(study, REMOVED, entry.place, cut.encode(), line, must=False)
        around = set()  # what only the whole of something knows is told there
        for depth in range(1, len(entry.place)):
            whole = at_place[entry.place[:depth]]
            around |= {_column(text, whole.begin), _column(text, whole.start)}
        for what, must in _instead(entry, rng):
            new = f"{text[: entry.start]} {what}{text[entry.end :]}"
            begins = _column(new, entry.start + 1)
            inside = {begins + 1} if what[0] in "[{" else set()
            columns = frozenset({_column(text, entry.begin), begins, *inside, *around})
            yield Wrong(
                study, f"written as {what}", entry.place, new.encode(), entry.line, must, columns
            )


def _column(text: str, at: int) -> int:
    return at - text.rfind("\n", 0, at)


REMOVED = "removed"


def _instead(entry: Entry, rng: random.Random) -> Iterator[tuple[str, bool]]:
    """Yield what a value may be written as by mistake, and whether it cannot be meant."""
    value, last = entry.value, entry.place[-1]
    free = last in FREE or bool(FREE & set(entry.place[-2:]))
    if isinstance(value, str):
        yield misspelt(rng, value), not free and ": " not in value
        for what in KINDS:
            yield what, what != "null" and not free
    elif isinstance(value, bool):
        for what in ("nope", "5", "[1]", "null"):
            yield what, what in {"[1]", "nope"}
    elif isinstance(value, int | float):
        named = OR_NAMES & {last, *entry.place[-2:]}
        for what, must in {**NUMBERS, **WORDS}.items():
            yield what, must and not (named and what in A_NAME)
    elif isinstance(value, Mapping | list):
        for what in ("word", "5", "null", "true"):
            yield what, what != "null"
        if value:
            yield ("[]" if isinstance(value, list) else "{}"), False


def texts(study: str, text: str) -> Iterator[Wrong]:
    """Yield what goes wrong with the file itself: tabs, duplicates, anchors, encodings."""
    for fault, raw, line, must in (*_lines(text), *_twice(text), *_files(text)):
        yield Wrong(study, fault, (), raw if isinstance(raw, bytes) else raw.encode(), line, must)


Text = tuple[str, str | bytes, int, bool]


def _lines(text: str) -> Iterator[Text]:
    lines = text.splitlines(keepends=True)
    for at, line in enumerate(lines, start=1):
        rest = line.lstrip(" ")
        if rest.startswith("#") or not rest.strip():
            continue
        if line != rest:
            for sign, what in (("\t", "a tab"), ("\u00a0", "a no-break space")):
                new = [*lines[: at - 1], sign + line[1:], *lines[at:]]
                yield f"line {at} with {what}", "".join(new), at, True
        elif re.search(r": +[^ #]", line.split(" #")[0]):
            new = [*lines[: at - 1], re.sub(r": +(?!#)", ":", line, count=1), *lines[at:]]
            yield f"line {at} without a space behind its colon", "".join(new), at, True
        for closing in "]}":
            code = line.split(" #")[0]
            if closing in code and "'" not in code:
                new = [*lines[: at - 1], line.replace(closing, "", 1), *lines[at:]]
                yield f"line {at} without {closing}", "".join(new), at, True


def _twice(text: str) -> Iterator[Text]:
    lines = text.splitlines(keepends=True)
    tops = [at for at, line in enumerate(lines) if line[0].isalpha()] + [len(lines)]
    for begin, end in itertools.pairwise(tops):
        again = lines[begin:end]
        new = [*lines[:end], *again, *lines[end:]]
        # Where an anchor is in what is there twice, it is noticed before the key.
        anchored = next((at for at, line in enumerate(again) if re.search(r" &\w", line)), 0)
        yield f"{lines[begin].split(':')[0]} twice", "".join(new), end + 1 + anchored, True


def _files(text: str) -> Iterator[Text]:
    lines = text.splitlines()
    title = next(at for at, line in enumerate(lines, start=1) if line.startswith("title: "))

    def titled(new: str) -> str:
        return text.replace("title: ", new, 1)

    yield "in UTF-16", text.encode("utf-16"), 1, True
    yield "in UTF-16 without a mark", text.encode("utf-16-le"), 1, True
    yield "in Latin 1", titled("title: Ü ").encode("latin-1"), title, True
    yield "with line ends of Windows", text.replace("\n", "\r\n"), 0, False
    yield "empty", "", 1, True
    yield "a comment", "# nothing\n", 1, True
    yield "a list", "- labcrane: 1\n", 1, True
    yield "a word", "labcrane\n", 1, True
    yield "two documents", f"{text}---\n{text}", len(lines) + 1, True
    yield "an alias of nothing", titled("title: *nothing #"), title, True
    yield "a merge of a word", titled("<<: "), title, True
    yield "a tag", titled("title: !!int "), title, True
    twice = titled("title: &a x\n#").replace("study: ", "study: &a ", 1)
    yield "an anchor twice", twice, title, True
