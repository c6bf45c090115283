"""Wrong protocols, made by walking what a right one says: one fault each, and the line it is in."""

import itertools
import random
import re
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, SequenceNode

from labcrane.analysis.scoring.settings import IndicatorSettings
from labcrane.protocol.pages import PageSettings
from labcrane.protocol.protocol import OnFault, Participants
from labcrane.protocol.streams import StreamNeed, TimeLimits
from labcrane.registry.hookspecs import ROLES
from labcrane.testing import Registry

PROTOCOLS = Path(__file__).parents[2] / "protocols"

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
assist:
  use: toward_target
  axes: [left.trigger, left.x, left.y, right.x, right.y]
  share: {estimate: load.ratio, between: [1, 2], to: [0, 1], at_most_per_s: 0.1}
estimates:
  load:
    use: band_power
    stream: brain
    fallback: {ratio: 1}
    channels: [Fz]
    per_channels: [Pz]
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

OTHERWISE = """\
labcrane: 1
study: otherwise
title: What everything leaves out
participants: {}
rate_hz: 200
machine:
  urdf: openmanipulator_x.urdf
  joints: {slew: joint1, shoulder: joint2, elbow: joint3, wrist: joint4}
  tip: gripper
  rest_deg: {elbow: 60}
  speeds_deg_s: {slew: 60, elbow: 60}
input:
  use: keyboard
  view: cab
  axes: {slew: [a, d], shoulder: [s, w], elbow: [k, i], wrist: [l, j], done: [q, space]}
operator:
  use: simulated_operator
  axes: [keyboard.slew, keyboard.shoulder, keyboard.elbow, keyboard.wrist]
  button: keyboard.done
scheme:
  use: joint_velocity
  map:
    slew: keyboard.slew
    shoulder: keyboard.shoulder
    elbow: keyboard.elbow
    wrist: keyboard.wrist
dynamics:
  use: mujoco_crane
  payload_kg: 0.05
  grapple: {mass_kg: 0.05, length_m: 0.05, size_m: 0.03, damping: 0.001}
tasks:
  press:
    use: aiming
    distances: [0.05, 0.1]
    width: 0.02
    centre: [0.2, 0, 0.1]
    end: trigger
    trigger: keyboard.done
    movements: 1
  stop:
    use: aiming
    distances: [5 cm, 10 cm]
    width: 2 cm
    centre: [0.2, 0, 0.1]
    end: rest_anywhere
    trigger: keyboard.done
    movements: 1
questionnaires:
  load: {use: nasa_tlx}
feedback:
  ball: {use: sphere}
views:
  cab:
    use: view
    camera: {name: side, eye: [0.3, -0.9, 0.5], look: targets}
    beside:
      - name: far
        eye: [0.2, 0.1, 0.9]
        look: [0.2, 0, 0]
        shows: depth
        depth_m: [0.1, 2]
        rate_hz: 20
        delay_s: 0.2
    keys: [a, d, s, w, k, i, l, j, q, space]
    hud: [block, distance, load]
    depth_cues: [tip_shadow, plumb_line]
    text_arcmin: 20
    viewing_m: 0.7
    screen_mm: 520
    areas: [tip, target, grapple]
    supervisor: {rate_hz: 4, width: 320}
  desk:
    use: view
    camera: top
    seen_by: examiner
    screen: 1
streams:
  gaze:
    name: Eyes
    rate_hz: 250
    channels: 4
    counter: Count
    latency_s: 0.01
    min_delay_s: 0.001
    required: false
monitors: {gaze: {use: gaze_signal}, keys: {use: stick_signal}}
triggers:
  port: {use: serial_ttl, port: /dev/ttyUSB0, codes: {trial.start: 1, trial.end: 2}}
  box: {use: box_ttl, port: COM3}
design:
  groups: {none: [], sphere: [ball]}
  order: {pairs: latin_square}
  tracks:
    stairs:
      factor: pairs
      levels: {0.1m_far_left: 1, 0.05m_far_left: 2}
      up_down: {harder_after: 3, steps: [1], reversals: 3}
      rounds: 4
      measure: movement_time
      at_most: 5
    quest:
      factor: pairs
      levels: {0.1m_far_left: 1, 0.05m_far_left: 2}
      quest_plus: {spreads: [0.5, 1], until_sd: 0.1}
      rounds: 4
      start: 0.1m_far_left
sessions:
  - name: only
    window_s: 90 min
    steps:
      - instructions: instructions.md
      - practice: {task: press, pairs: 1, feedback: all, until: {successes: 1}}
      - block: {task: press, fading: [1, 0.5, 0], feedback: group}
      - block: {task: press, name: stair, track: stairs, feedback: none}
      - block: {task: stop, name: quest, track: quest, feedback: none}
      - questionnaire: [load]
environment: record
on_fault: {feedback_lost: pause}
expected:
  - dynamics.grapple.mass_kg
  - dynamics.grapple.damping
  - views.cab.hud
  - sessions.1.steps.2.practice.feedback
"""
"""What cannot stand beside what is in everything: a robot's file, a keyboard, a load, tracks."""

SKELETONS = {"everything": SKELETON, "otherwise": OTHERWISE}


def lay_out(study: str, folder: Path) -> None:
    """Put what a study needs beside its protocol into a folder."""
    shutil.copytree(PROTOCOLS / ("aiming" if study in SKELETONS else study), folder)
    if study in SKELETONS:
        shutil.copy(PROTOCOLS.parent / "examples" / "machines" / ROBOT, folder)


ROBOT = "openmanipulator_x.urdf"


def right(study: str, registry: Registry) -> str:
    """Return a right protocol; one of ours writes out every setting of what it uses."""
    if study not in SKELETONS:
        return (PROTOCOLS / study / "protocol.yaml").read_text(encoding="utf-8")
    data = YAML().load(SKELETONS[study])
    for role, entry in ROLES.items():
        for key in entry.keys:
            uses = data.get(key) or {}
            for use in uses.values() if entry.several else [uses]:
                if isinstance(use, Mapping) and use.get("use") in registry.offers[role]:
                    _fill(use, registry.offers[role][use["use"]].settings)
    for key, model in (
        ("participants", Participants),
        ("page", PageSettings),
        ("on_fault", OnFault),
        ("sync", TimeLimits),
        ("indicator", IndicatorSettings),
    ):
        _fill(data.setdefault(key, {}), model)
    for stream in data["streams"].values():
        _fill(stream, StreamNeed)
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
    gone
        What was there, of something that is missed; otherwise empty.
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
    gone: str = ""

    def __str__(self) -> str:
        return f"{self.study} {'.'.join(map(str, self.place))}: {self.fault}"

    def is_missed(self, line: int, message: str) -> bool:
        """Whether it may be told in a line that something is missed.

        Where it was, what it was in, and whatever names it or what was in it; or elsewhere if the
        message names it: a scheme needs the axis of a valve, and nothing in the file says so.
        """
        words = set(re.findall(r"\w+", f"{self.place[-1]} {self.gone}"))
        return line in self._around(words) or bool(words & set(re.findall(r"\w+", message)))

    def _around(self, words: set[str]) -> set[int]:
        text = self.text.decode()
        try:
            at = {each.place: each.line for each in entries(text)}
        except YAMLError:  # an anchor went with it
            at = {}
        found = {at.get(self.place[:depth], 1) for depth in range(len(self.place))}
        found |= {self.line, at.get(self.place, self.line)}
        for number, line in enumerate(text.splitlines(), start=1):
            if words & set(re.findall(r"\w+", line)):
                found.add(number)
        return found


FREE = {"title", "name", "text", "left", "right", "pattern", "language", "type", "source_id",
        "rights", "study", "host", "stick", "bus", "colour"}  # fmt: skip
"""Keys whose text is a person's own, or may be spelt in more than one way."""

OF_LAB = {
    ("tasks",),
    ("questionnaires",),
    ("feedback",),
    ("views",),
    ("streams",),
    ("monitors",),
    ("triggers",),
    ("estimates",),
    ("input", "axes"),
    ("design", "groups"),
    ("design", "tracks"),
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
            gone = text[entry.left : entry.right]
            yield Wrong(study, REMOVED, entry.place, cut.encode(), line, must=False, gone=gone)
        around = set()  # what only the whole of something knows is told there
        for depth in range(1, len(entry.place)):
            whole = at_place[entry.place[:depth]]
            around |= {_column(text, whole.begin), _column(text, whole.start)}
        for what, must in _instead(entry, rng):
            new = f"{text[: entry.start]} {what}{text[entry.end :]}"
            begins = _column(new, entry.start + 1)
            inside = {begins + 1} if what[0] in "[{" else set()
            columns = frozenset({_column(text, entry.begin), begins, *inside, *around})
            named = last == "name" or "keys" in holder[-1:]  # others name it
            gone = text[entry.start : entry.end] if what in NOTHING or named else ""
            yield Wrong(
                study,
                f"written as {what}",
                entry.place,
                new.encode(),
                entry.line,
                must,
                columns,
                gone,
            )


NOTHING = {"{}", "[]", "null"}
"""What is written instead of something misses what was in it."""


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
    yield "bytes", titled("title: !!binary aGVsbG8= #"), title, True
    yield "a quotation that is not closed", titled("title: '"), title, True
    yield "as YAML 1.1", f"%YAML 1.1\n---\n{text}", 1, True
    yield "a list for a key", f"{text}? [a]\n: b\n", len(lines) + 1, True
    yield "nothing for a key", f"{text}~: b\n", len(lines) + 1, True
    yield "a key twice, once as a number", f"{text}'5': a\n5: b\n", len(lines) + 2, True
    twice = titled("title: &a x\n#").replace("study: ", "study: &a ", 1)
    yield "an anchor twice", twice, title, True
