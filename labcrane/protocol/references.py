"""References of components' settings, looked up among all that the protocol's components name."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from os.path import normpath
from pathlib import Path

from labcrane.core.events import OF_SESSION
from labcrane.core.references import Covers, Mentioned, Once, Reference, mentioned
from labcrane.core.roles import Component, Task
from labcrane.core.settings import EstimateSettings, Settings
from labcrane.errors import LabcraneError, nearest
from labcrane.files.names import absent, outside
from labcrane.files.system import is_file, is_there
from labcrane.files.yaml import Place, YamlFile
from labcrane.machines.machine import Machine
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.protocol import ASSIST, Assist
from labcrane.protocol.referenced_files import paths_in, used

Known = frozenset[str] | None
"""The names of a kind; None where a component of the study does not say what it has."""

OWNERS: Mapping[str, str] = {
    "axis": "the input",
    "axis of the input": "it",
    "button": "the input",
    "joint": "the machine",
    "link": "the machine",
    "scene": "the dynamics",
    "signal": "the study",
    "event": "the study",
    "object": "the picture",
    "estimate": "the study",
    "view": "the protocol",
}
"""Owners of the names of a kind, for messages; other kinds belong to the study."""

READ_BY_BUILDING = frozenset({"input", ASSIST, "operator", "scheme", "dynamics"})
"""Keys of components that open the files of their settings when they are built: a check builds
those that name any. Views and sounds are built by a rehearsal."""

BUILT = frozenset({"tasks", "questionnaires"})
"""Keys of the components that a check builds; it reports the mistakes that building finds."""


@dataclass(frozen=True)
class Parts:
    """The parts of a protocol, as far as it could be read.

    Attributes
    ----------
    machine
        What is operated.
    components
        The chosen components, by their place in the protocol.
    tasks
        The tasks that could be built.
    sections
        Parts of the protocol that belong to no component, by their place.
    faulty
        Components with wrong numbers, which were noted; here they have their defaults.
    """

    machine: Machine
    components: Mapping[Place, ComponentSpec]
    tasks: Mapping[str, Task]
    sections: Mapping[Place, Settings] = field(default_factory=dict)
    faulty: Set[Place] = frozenset()


class ReferenceChecker:
    """Notes every name that refers to nothing, at its place."""

    def __init__(self, source: YamlFile, parts: Parts) -> None:
        self._source = source
        self._machine = parts.machine
        self._components = parts.components
        self._tasks = parts.tasks
        self._sections = parts.sections
        self._faulty = parts.faulty
        self._known: dict[str, Known] = {}
        self._noted: set[Place] = set()  # files of which something was said

    def check(self) -> None:
        """Look up the names in every component's settings, and those that they need implicitly."""
        self._check_sections()
        self._check_assistant()
        for place, choice in self._components.items():
            before = self._source.wrong
            settings = choice.settings
            written = list(mentioned(settings))
            for mention in written:
                at = (*place, *mention.place)
                if mention.mark == Reference("file"):
                    self._is_there(at, mention.value)
                elif isinstance(mention.mark, Reference):
                    self._refers(at, mention, mention.mark, choice)
                elif place != ("operator",):
                    self._whole(at, mention, choice)
            for kind, names in self._needed(place, settings):
                known = self._names(kind, place) if kind in OWNERS else self._own(choice, kind)
                said = {mention.value for mention in written if mention.mark == Reference(kind)}
                for name in names:
                    if known is not None and name not in known and name not in said:
                        message = f"{_dotted(place)} needs the {kind} {name!r}, and "
                        self._source.problem(place, message + _has(kind, name, known))
            if place[0] in READ_BY_BUILDING:
                self._read(
                    place, choice, faulty=self._source.wrong > before or place in self._faulty
                )

    def _read(self, place: Place, choice: ComponentSpec, *, faulty: bool) -> None:
        """Build a component that names files, so that mistakes in the files are found before a run.

        Of a component that is ``faulty`` anyway, only mistakes in the files are reported, once.
        """
        named = [key for key, each in choice.settings if any(paths_in(each))]
        if not named or choice.offer.missing:
            return
        try:
            choice.build(self._machine)
        except LabcraneError as error:
            said = getattr(error, "at", ())
            at = said or named[:1]
            if (*place, *at) in self._noted or (faulty and said[:1] not in [(n,) for n in named]):
                return
            self._source.problem((*place, *at), f"{_dotted((*place, *at))}: {error}")

    def _check_sections(self) -> None:
        """Look up the files that the protocol names in addition to its components."""
        for place, section in self._sections.items():
            before = self._source.wrong
            for mention in mentioned(section):
                at = (*place, *mention.place)
                if mention.mark == Reference("file"):
                    self._is_there(at, mention.value)
                elif isinstance(mention.mark, Reference):
                    self._refers(at, mention, mention.mark)
            if self._source.wrong == before:
                list(self._needed(place, section))  # looks into its files

    def _refers(
        self, at: Place, mention: Mentioned, mark: Reference, choice: ComponentSpec | None = None
    ) -> None:
        written = mention.value
        known = self._holds(mark, mention, choice, at)
        if known is None:
            return
        if isinstance(written, Path):
            self._is_the_file(at, mark, written, known)
        elif (name := mark.bare(written)) not in known:
            message = f"{_dotted(at)} is {written!r}, and {_has(mark.kind, name, known)}"
            self._source.problem(at, message, key=mention.key)

    def _is_the_file(self, at: Place, mark: Reference, path: Path, known: frozenset[str]) -> None:
        """Note a file that is not among the known ones, which have a path or a name."""
        name = _stem(path)
        if name in known or normpath(path) in map(normpath, known):
            return
        named = {_stem(Path(each)): each for each in known}
        what = f"{_dotted(at)} is {name!r}, and "
        if name in named:
            owner = OWNERS.get(mark.kind, "it")
            what += f"{owner} has another file of that name, {named[name]}; name the same one"
        else:
            what += _has(mark.kind, name, frozenset(named))
        self._source.problem(at, what)

    def beyond_the_operator(self) -> Iterator[tuple[Place, str]]:
        """Yield axes and buttons of the input that the operator, its substitute, does not have.

        Each comes with the place where it is named, and its name.
        """
        parts = [(place, choice.settings) for place, choice in self._components.items()]
        for place, settings in (*parts, *self._sections.items()):
            if place in {("input",), ("operator",)}:
                continue
            for at, kind, name in self._controls(place, settings):
                if name in (self._names(kind, at) or ()):
                    has = self._found(kind, "operator")
                    if has is not None and name not in has:
                        yield at, name

    def _controls(self, place: Place, settings: Settings) -> Iterator[tuple[Place, str, str]]:
        """Yield the axes and buttons that settings name: where, which of the two, and the name."""
        for each in mentioned(settings):
            mark = each.mark
            if not isinstance(mark, Reference) or mark.own or mark.of:
                continue
            if mark.kind in {"axis", "button"}:
                yield (*place, *each.place), mark.kind, mark.bare(str(each.value))
        for kind, names in self._needed(place, settings):
            if kind in {"axis", "button"}:
                yield from ((place, kind, name) for name in names)

    def _check_assistant(self) -> None:
        """Note axes and buttons of the scheme that the assistant does not have."""
        scheme = self._components.get(("scheme",))
        has = self._found("axis", ASSIST)
        if scheme is None or has is None:
            return
        named = [name for _, _, name in self._controls(("scheme",), scheme.settings)]
        if lacks := [name for name in dict.fromkeys(named) if name not in has]:
            message = (
                f"assist moves {', '.join(sorted(has))}, and the scheme uses {', '.join(lacks)}; "
                f"name what it uses, as axes: [{', '.join(dict.fromkeys(named))}]"
            )
            self._source.problem((ASSIST, "use"), message)

    def _holds(
        self, mark: Reference, mention: Mentioned, choice: ComponentSpec | None, at: Place
    ) -> Known:
        if choice is None:
            return self._names(mark.kind, at)
        if mark.of:
            view = self._components.get(("views", str(getattr(choice.settings, mark.of, ""))))
            return self._own(view, mark.kind) if view else None  # a missing view is reported there
        if mark.own:
            return self._of_holders(mention, mark.kind, choice)
        return self._names(mark.kind, at)

    def _of_holders(self, mention: Mentioned, kind: str, choice: ComponentSpec) -> Known:
        """Return a component's names of a kind, from its innermost settings."""
        for holder in reversed(mention.holders[1:]):
            if isinstance(holder, Settings) and kind in (said := holder.provides(self._machine)):
                return frozenset(said[kind])
        return self._own(choice, kind)

    def _is_there(self, at: Place, path: Path) -> None:
        """Note a file that is not there, or would not move with the study; so with what it uses."""
        folder, before = self._source.path.parent, self._source.wrong
        if why := outside(path, folder):
            self._source.problem(at, f"{_dotted(at)} is {path.name!r}, and {why}")
        elif not is_there(path):
            self._source.problem(at, f"{_dotted(at)} is {path.name!r}, and {absent(path)}")
        elif not is_file(path):
            self._source.problem(
                at, f"{_dotted(at)} is {path.name!r}, which is a folder; name a file in it"
            )
        else:
            for each in used(path):
                if why := outside(each, folder):
                    what = f"{_dotted(at)} is {path.name!r}, which uses {each.name!r}, and {why}"
                    self._source.problem(at, what)
        if self._source.wrong > before:
            self._noted.add(at)

    def _needed(self, place: Place, settings: Settings) -> Iterator[tuple[str, Sequence[str]]]:
        try:
            if place[0] not in BUILT:
                settings.provides(self._machine)
            yield from settings.needs(self._machine).items()
        except LabcraneError as error:  # a file that it has to look into
            at = getattr(error, "at", ())
            self._noted.add((*place, *at))
            self._source.problem((*place, *at), str(error))

    def _own(self, choice: ComponentSpec, kind: str) -> Known:
        said = self._said(choice, kind)
        return None if said is None else frozenset(said)

    def _whole(self, at: Place, mention: Mentioned, choice: ComponentSpec) -> None:
        """Note keys that a mapping lacks or has twice."""
        mark, value = mention.mark, mention.value
        if isinstance(mark, Covers):
            own = self._of_holders(mention, mark.kind, choice) if mark.own else None
            known = own or self._names(mark.kind, at) or frozenset()
            for name in [name for name in self._ordered(mark.kind, known) if name not in value]:
                message = f"{_dotted(at)} has nothing for the {mark.kind} {name!r}; it needs one "
                every = ", ".join(self._ordered(mark.kind, known))
                message = f"{message}for each of {every}{self._otherwise(mark, len(known), at)}"
                self._source.problem(at, message)
        elif isinstance(mark, Once):
            items = value.items() if isinstance(value, Mapping) else enumerate(value)
            first: dict[str, object] = {}
            for key, item in items:
                name = str(item).removeprefix("-")
                if name in first:
                    message = f"{_dotted(at)} has {name!r} twice; write it once"
                    if isinstance(key, str):
                        both = f"both {first[name]!r} and {key!r}"
                        message = f"{_dotted(at)} has {name!r} for {both}; give each its own"
                    self._source.problem((*at, key), message)
                first.setdefault(name, key)

    def _otherwise(self, mark: Covers, needed: int, at: Place) -> str:
        """Return what can be done where the input has too few axes to cover all."""
        axes = self._names("axis", at)
        if not mark.otherwise or axes is None:
            return ""
        moved = axes - (self._of([("input",)], "button") or frozenset())
        if len(moved) >= needed:
            return ""
        return f", and the input has {len(moved)} axes; {mark.otherwise}"

    def _ordered(self, kind: str, known: frozenset[str]) -> Sequence[str]:
        return self._machine.names if kind in {"joint", "link"} else sorted(known)

    def _names(self, kind: str, place: Place) -> Known:
        """Return the names of a kind; those of the input are the operator's for the operator."""
        key = f"operator {kind}" if place[0] == "operator" and kind == "axis" else kind
        if key not in self._known:
            device = "operator" if key != kind else "input"
            self._known[key] = self._values() if kind == "estimate" else self._found(kind, device)
        return self._known[key]

    def _found(self, kind: str, device: str) -> Known:
        if kind in {"joint", "link"}:
            return frozenset(self._machine.names)
        if kind == "view":
            views = self._source.data.get("views")
            return frozenset(views if isinstance(views, dict) else ())
        if kind in {"axis", "axis of the input"}:
            said = self._of([(device,)], "axis")
            return None if said is None else frozenset(n for n in said if not _is_status(n))
        if kind == "scene":
            return self._of([("dynamics",)], kind)
        if kind == "button":
            said = self._of([(device,)], kind)
            return self._found("axis", device) if said is None else said
        if kind == "signal":
            given = self._of([("scheme",), ("dynamics",)], kind)
            shown = {c for each in self._tasks.values() for s in each.signals for c in s.columns}
            if (ASSIST,) in self._components:
                shown |= {c for s in Assist.signals(self._machine.names) for c in s.columns}
            return None if given is None or not self._all_tasks else given | shown
        if kind == "event":
            given = self._of(self._places("tasks"), kind)
            return None if given is None else given | OF_SESSION
        if kind == "object":
            given = self._of([("dynamics",), *self._places("tasks", "feedback", "views")], kind)
            return None if given is None else given | {*self._machine.names, "foot"}
        return self._of(list(self._components), kind)

    def _values(self) -> Known:
        """Return the values of the estimates; None unless all of them could be read."""
        found: set[str] = set()
        for place in self._places("estimates"):
            choice = self._components.get(place)
            if choice is None or not isinstance(choice.settings, EstimateSettings):
                return None
            found |= {f"{place[1]}.{value}" for value in choice.settings.values}
        return frozenset(found)

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
        """Return the names of the components at these places; None unless all state them."""
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


def _is_status(axis: str) -> bool:
    """Whether a number of an input states that a device is connected; no hand changes it."""
    return axis.rsplit(".", maxsplit=1)[-1] == "connected"


def _stem(path: Path) -> str:
    return path.name.split(".")[0]


def _columns(component: Component) -> Iterator[str]:
    for signal in component.signals:
        yield from signal.columns


def _has(kind: str, name: str, known: frozenset[str]) -> str:
    """Return the existing names, and the nearest one."""
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
