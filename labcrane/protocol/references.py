"""References of components' settings, looked up among all that the protocol's components name."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from labcrane.core.references import EVENTS, Covers, Mark, Mentioned, Once, Reference, mentioned
from labcrane.core.roles import Component, Task
from labcrane.core.settings import Settings
from labcrane.errors import LabcraneError, nearest
from labcrane.files.names import absent
from labcrane.files.system import is_there
from labcrane.files.yaml import Place, YamlFile
from labcrane.machines.machine import Machine
from labcrane.protocol.components import ComponentSpec

Known = frozenset[str] | None
"""The names of a kind; None where a component of the study does not say what it has."""

OWNERS: Mapping[str, str] = {
    "axis": "the input",
    "button": "the input",
    "joint": "the machine",
    "link": "the machine",
    "scene": "the dynamics",
    "signal": "the study",
    "event": "the study",
    "object": "the picture",
    "view": "the protocol",
}
"""Who has the names of a kind, for the message; any other kind is the study's."""


@dataclass(frozen=True)
class Parts:
    """What a protocol is made of, as far as it could be read.

    Attributes
    ----------
    machine
        What is operated.
    components
        What was chosen, by its place in the protocol.
    tasks
        The tasks that could be built.
    sections
        Parts of the protocol that are nobody's components, by their place.
    """

    machine: Machine
    components: Mapping[Place, ComponentSpec]
    tasks: Mapping[str, Task]
    sections: Mapping[Place, Settings] = field(default_factory=dict)


class ReferenceChecker:
    """Notes every name that refers to nothing, at its place."""

    def __init__(self, source: YamlFile, parts: Parts) -> None:
        self._source = source
        self._machine = parts.machine
        self._components = parts.components
        self._tasks = parts.tasks
        self._sections = parts.sections
        self._known: dict[str, Known] = {}

    def check(self) -> None:
        """Look up what every component's settings mention, and what they need unmentioned."""
        self._check_sections()
        for place, choice in self._components.items():
            settings = choice.settings
            written = list(mentioned(settings))
            for mention in written:
                at = (*place, *mention.place)
                if mention.mark == Reference("file"):
                    self._is_there(at, mention.value)
                elif isinstance(mention.mark, Reference):
                    self._refers(at, mention, mention.mark, choice)
                elif place != ("operator",):
                    self._whole(at, mention.mark, mention.value)
            for kind, names in self._needed(place, settings):
                known = self._names(kind, place) if kind in OWNERS else self._own(choice, kind)
                said = {mention.value for mention in written if mention.mark == Reference(kind)}
                for name in names:
                    if known is not None and name not in known and name not in said:
                        message = f"{_dotted(place)} needs the {kind} {name!r}, and "
                        self._source.problem(place, message + _has(kind, name, known))

    def _check_sections(self) -> None:
        """Look up the files that the protocol names beside its components."""
        for place, section in self._sections.items():
            for mention in mentioned(section):
                if mention.mark == Reference("file"):
                    self._is_there((*place, *mention.place), mention.value)

    def _refers(
        self, at: Place, mention: Mentioned, mark: Reference, choice: ComponentSpec
    ) -> None:
        written = mention.value
        name = written.name.split(".")[0] if isinstance(written, Path) else mark.bare(written)
        known = self._holds(mark, choice, at)
        if known is None or name in known:
            return
        said = name if isinstance(written, Path) else written
        message = f"{_dotted(at)} is {said!r}, and {_has(mark.kind, name, known)}"
        self._source.problem(at, message, key=mention.key)

    def beyond_the_operator(self) -> Iterator[tuple[Place, str]]:
        """Yield axes and buttons of the input that the operator who stands in for it has not.

        That is where each is named, and its name.
        """
        for place, choice in self._components.items():
            if place in {("input",), ("operator",)}:
                continue
            named = [
                ((*place, *each.place), each.mark.kind, each.mark.bare(str(each.value)))
                for each in mentioned(choice.settings)
                if isinstance(each.mark, Reference) and not (each.mark.own or each.mark.of)
            ]
            needed = self._needed(place, choice.settings)
            named += [(place, kind, name) for kind, names in needed for name in names]
            for at, kind, name in named:
                if kind in {"axis", "button"} and name in (self._names(kind, at) or ()):
                    has = self._found(kind, "operator")
                    if has is not None and name not in has:
                        yield at, name

    def _holds(self, mark: Reference, choice: ComponentSpec, at: Place) -> Known:
        if mark.of:
            view = self._components.get(("views", str(getattr(choice.settings, mark.of, ""))))
            return self._own(view, mark.kind) if view else None  # that there is none is told there
        return self._own(choice, mark.kind) if mark.own else self._names(mark.kind, at)

    def _is_there(self, at: Place, path: Path) -> None:
        if not is_there(path):
            self._source.problem(at, f"{_dotted(at)} is {path.name!r}, and {absent(path)}")

    def _needed(self, place: Place, settings: Settings) -> Iterator[tuple[str, Sequence[str]]]:
        try:
            yield from settings.needs(self._machine).items()
        except LabcraneError as error:  # a file that it has to look into
            self._source.problem(place, str(error))

    def _own(self, choice: ComponentSpec, kind: str) -> Known:
        said = self._said(choice, kind)
        return None if said is None else frozenset(said)

    def _whole(self, at: Place, mark: Mark, value: Any) -> None:
        """Note what a mapping leaves out or has twice."""
        if isinstance(mark, Covers):
            known = self._names(mark.kind, at) or frozenset()
            for name in [name for name in self._ordered(mark.kind, known) if name not in value]:
                message = f"{_dotted(at)} has nothing for the {mark.kind} {name!r}; it needs one "
                every = ", ".join(self._ordered(mark.kind, known))
                self._source.problem(at, f"{message}for each of {every}")
        elif isinstance(mark, Once):
            items = value.items() if isinstance(value, Mapping) else enumerate(value)
            first: dict[str, object] = {}
            for key, item in items:
                name = str(item).removeprefix("-")
                if name in first:
                    both = f"{first[name]!r} and {key!r}" if isinstance(key, str) else "two of them"
                    message = f"{_dotted(at)} has {name!r} for both {both}; give each its own"
                    self._source.problem((*at, key), message)
                first.setdefault(name, key)

    def _ordered(self, kind: str, known: frozenset[str]) -> Sequence[str]:
        return self._machine.names if kind in {"joint", "link"} else sorted(known)

    def _names(self, kind: str, place: Place) -> Known:
        """Return the names of a kind; those of the input are the operator's for the operator."""
        key = f"operator {kind}" if place[0] == "operator" and kind == "axis" else kind
        if key not in self._known:
            self._known[key] = self._found(kind, "operator" if key != kind else "input")
        return self._known[key]

    def _found(self, kind: str, device: str) -> Known:
        if kind in {"joint", "link"}:
            return frozenset(self._machine.names)
        if kind == "view":
            views = self._source.data.get("views")
            return frozenset(views if isinstance(views, dict) else ())
        if kind == "axis":
            return self._of([(device,)], kind)
        if kind == "scene":
            return self._of([("dynamics",)], kind)
        if kind == "button":
            said = self._of([(device,)], kind)
            return self._of([(device,)], "axis") if said is None else said
        if kind == "signal":
            given = self._of([("scheme",), ("dynamics",)], kind)
            shown = {c for each in self._tasks.values() for s in each.signals for c in s.columns}
            return None if given is None or not self._all_tasks else given | shown
        if kind == "event":
            given = self._of(self._places("tasks"), kind)
            return None if given is None else given | set(EVENTS)
        if kind == "object":
            given = self._of([("dynamics",), *self._places("tasks", "feedback", "views")], kind)
            return None if given is None else given | {*self._machine.names, "foot"}
        return self._of(list(self._components), kind)

    @cached_property
    def _all_tasks(self) -> bool:
        return len(self._tasks) == len(self._places("tasks"))

    def _places(self, *keys: str) -> list[Place]:
        """Return where the protocol names components under these keys, chosen or not."""
        found: list[Place] = []
        for key in keys:
            written = self._source.data.get(key)
            found += [(key, name) for name in written] if isinstance(written, dict) else []
        return found

    def _of(self, places: Sequence[Place], kind: str) -> Known:
        """Return what the components at these places have; None unless all of them say."""
        found: set[str] = set()
        for place in places:
            choice = self._components.get(place)
            said = None if choice is None else self._said(choice, kind)
            if said is None:
                return None
            found |= set(said)
        return frozenset(found)

    def _said(self, choice: ComponentSpec, kind: str) -> Sequence[str] | None:
        try:
            if (said := choice.settings.provides(self._machine).get(kind)) is not None:
                return said
            if kind in {"axis", "signal"} and not choice.offer.missing:
                return tuple(_columns(choice.build(self._machine)))
        except LabcraneError:
            return None  # what is wrong with the component is said where it is built or installed
        return None


def _columns(component: Component) -> Iterator[str]:
    for signal in component.signals:
        yield from signal.columns


def _has(kind: str, name: str, known: frozenset[str]) -> str:
    """Return what there is, and the nearest name."""
    there = nearest(name, sorted(known), f"{OWNERS.get(kind, 'it')} has")
    return f"there is no such {kind}; {there}"


def _dotted(place: Place) -> str:
    text = ""
    for step in place:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def twice(names: Sequence[str]) -> list[str]:
    """Return the names that come more than once, in their order."""
    return [name for name, count in Counter(names).items() if count > 1]
