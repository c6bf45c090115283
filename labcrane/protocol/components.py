"""Components that a protocol uses, found among those installed."""

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from labcrane.core.roles import Component, Cue, Feedback, Questionnaire, SignalMonitor
from labcrane.core.settings import Settings
from labcrane.errors import PluginError, ProtocolError, meant
from labcrane.files.complaints import named
from labcrane.files.names import outside
from labcrane.files.yaml import Place, YamlFile
from labcrane.machines.library import read_machine
from labcrane.machines.machine import Machine
from labcrane.protocol.protocol import Protocol, Use
from labcrane.protocol.referenced_files import YAML, plain_settings, used
from labcrane.registry.call_monitor import CallMonitor
from labcrane.registry.hookspecs import ROLES
from labcrane.registry.offers import Offer
from labcrane.registry.proxies import watched
from labcrane.registry.registry import Registry

RoleT = TypeVar("RoleT", bound=Component)


@dataclass(frozen=True, slots=True)
class ComponentSpec:
    """A component that a protocol names, and its settings."""

    name: str
    plugin: str
    offer: Offer[Component]
    settings: Settings
    call_monitor: CallMonitor = field(default_factory=CallMonitor, compare=False)
    called: str = field(default="", compare=False)
    """Its place in the protocol, and its name: ``study.yaml:7:14: input 'dual_joystick'``."""

    def described(self, folder: Path) -> dict[str, Any]:
        """Return it ready for JSON, with the study's files named from its ``folder``."""
        settings = plain_settings(self.settings, folder)
        return {"use": self.name, "plugin": self.plugin, "settings": settings}

    def build(self, machine: Machine) -> Component:
        """Build, but do not open, the component, under a call monitor.

        Raises
        ------
        PluginError
            A module that it needs is not installed, or building fails.
        """
        if missing := self.offer.missing:
            raise PluginError(f"{self.called or repr(self.name)} {missing}")
        build = self.call_monitor.place(repr(self.name), self.plugin, "build", self.offer.build)
        component = self.call_monitor.call(build, self.offer.build, self.settings, machine)
        return watched(component, self.name, self.plugin, self.call_monitor)


class ComponentResolver:
    """Finds what a protocol names, and notes every mistake in its file."""

    def __init__(self, source: YamlFile, registry: Registry) -> None:
        self._source = source
        self._registry = registry
        self.call_monitor = CallMonitor()
        self.but_for_numbers: dict[Place, ComponentSpec] = {}
        """Components with nothing wrong but numbers, with defaults for these: names in them, and
        those that they give, can be looked up all the same."""

    def choose(
        self,
        role: type[RoleT],
        place: Place,
        default: Use | None = None,
        beside: Container[str] = (),
    ) -> ComponentSpec | None:
        """Return the component that the protocol uses at ``place``, or note why there is none.

        The keys ``beside`` its settings are the protocol's own.
        """
        written = self._at(place)
        if written is None and default is not None:
            use = default
        elif isinstance(written, dict) and isinstance(written.get("use"), str):
            use = Use.model_validate({k: v for k, v in written.items() if k not in beside})
        else:
            return None  # noted by the protocol's own check
        return self._choice(role, use, place, (*place, "use"))

    def choose_several(self, role: type[RoleT], key: str) -> dict[str, ComponentSpec]:
        """Return the components under a key that can be chosen, by the protocol's names."""
        written = self._at((key,))
        names = written if isinstance(written, dict) else {}
        chosen = {name: self.choose(role, (key, name)) for name in names}
        return {name: choice for name, choice in chosen.items() if choice}

    def choose_others(self) -> dict[str, ComponentSpec]:
        """Return the protocol's components of roles that have no field of their own in a study."""
        found: dict[str, ComponentSpec] = {}
        for role, entry in ROLES.items():
            for key in entry.keys:
                if key in Protocol.model_fields:
                    continue
                if entry.several:
                    several = self.choose_several(role, key)
                    found |= {f"{key}.{name}": choice for name, choice in several.items()}
                elif choice := self.choose(role, (key,)):
                    found[key] = choice
        return found

    def choose_monitors(self) -> dict[str, ComponentSpec] | None:
        """Return the monitors of signals by the protocol's names; None where it leaves them out."""
        written = self._at(("monitors",))
        return None if written is None else self.choose_several(SignalMonitor, "monitors")

    def choose_questionnaires(self, protocol: Protocol) -> dict[str, ComponentSpec]:
        """Return the questionnaires that the protocol asks, noting those that there are not."""
        chosen: dict[str, ComponentSpec | None]
        chosen = dict.fromkeys(protocol.questionnaires) | self.choose_several(
            Questionnaire, "questionnaires"
        )
        for place, name in self._asked(protocol):
            if name in chosen:
                continue
            own = meant(name, list(protocol.questionnaires))
            if own and name not in self._registry.offers[Questionnaire]:
                listed = ", ".join(protocol.questionnaires)
                message = f"there is no questionnaire {name!r}; {own} the protocol has {listed}"
                self._source.problem(place, message)
            else:
                chosen[name] = self._choice(Questionnaire, Use(use=name), place, place)
        return {name: choice for name, choice in chosen.items() if choice}

    def _asked(self, protocol: Protocol) -> Iterator[tuple[Place, str]]:
        for number, session in enumerate(protocol.sessions):
            for at, step in enumerate(session.steps):
                place: Place = ("sessions", number, "steps", at)
                written = self._at(place)
                kind = next(iter(written)) if isinstance(written, dict) and written else step.kind
                several = isinstance(self._at((*place, kind)), list)
                for index, name in enumerate(step.questionnaires):
                    yield (*place, kind, index) if several else (*place, kind), name
                for index, name in enumerate(step.block.ask if step.block else ()):
                    yield (*place, kind, "ask", index), name
        for number, rule in enumerate(protocol.stop_rules):
            if rule.questionnaire is not None:
                yield ("stop_rules", number, "questionnaire"), rule.questionnaire

    def _choice(
        self, role: type[RoleT], use: Use, place: Place, named: Place
    ) -> ComponentSpec | None:
        """Return what is used at ``place``; its name stands at ``named``."""
        try:
            offer = self._registry.find(role, use.use)
        except PluginError as error:
            self._source.problem(named, str(error))
            return None
        settings = self._source.check(offer.settings, place, use.settings)
        plugin = self._registry.plugin(role, use.use)
        called = f"{self._source.where(named)}: {ROLES[role].word} {use.use!r}"
        if settings is None:
            if rest := self._source.but_for_numbers(offer.settings, use.settings):
                self.but_for_numbers[place] = ComponentSpec(
                    use.use, plugin, offer, rest, self.call_monitor, called
                )
            return None
        return ComponentSpec(use.use, plugin, offer, settings, self.call_monitor, called)

    def choose_feedback(
        self,
    ) -> tuple[dict[str, ComponentSpec], dict[str, ComponentSpec], dict[str, ComponentSpec]]:
        """Return cues, sounds and views by the protocol's names for them."""
        cues, sounds = {}, {}
        written = self._at(("feedback",))
        for name, use in (written if isinstance(written, dict) else {}).items():
            is_cue = self._is_cue(use.get("use") if isinstance(use, dict) else None)
            place = ("feedback", name)
            if is_cue and (choice := self.choose(Cue, place)):
                cues[name] = choice
            elif not is_cue and (choice := self.choose(Feedback, place)):
                sounds[name] = choice
        views = self.choose_several(Feedback, "views")
        for name in views.keys() & {*cues, *sounds}:
            self._source.problem(("views", name), f"{name!r} is already the name of a feedback")
        return cues, sounds, views

    def _is_cue(self, name: object) -> bool:
        """Whether what is named under ``feedback`` is a cue, or is one misspelt."""
        if not isinstance(name, str):
            return False
        if (roles := self._registry.roles(name)) & {Cue, Feedback}:
            return Cue in roles
        cues, others = self._registry.offers[Cue], self._registry.offers[Feedback]
        return bool(get_close_matches(name, cues)) and not get_close_matches(name, others)

    def machine(self) -> tuple[Machine, str] | None:
        """Return the machine and its file's text, or note what is wrong."""
        name, folder = self._at(("machine",)), self._source.path.parent
        if not self._source.recorded and (why := _elsewhere(name, folder)):
            at, what = why
            self._source.problem(("machine", *at), what)
            return None
        try:
            if isinstance(name, dict):
                # Few machines are described so, and every command would read what describes them.
                from labcrane.machines.descriptions.description import (  # noqa: PLC0415
                    MachineDescription,
                )

                described = self._source.check(MachineDescription, ("machine",))
                return described.read(folder) if described else None
            if not isinstance(name, str):
                return None  # noted by the protocol's own check
            return read_machine(name, folder, recorded=self._source.recorded)
        except ProtocolError as error:
            self._source.problem(("machine", *error.at), str(error))
            return None

    def build(
        self,
        role: type[RoleT],
        section: str,
        choices: Mapping[str, ComponentSpec],
        machine: Machine,
    ) -> dict[str, RoleT]:
        """Return the components that a section names, built; note those that cannot be built."""
        built: dict[str, RoleT] = {}
        for name, choice in choices.items():
            try:
                component = choice.build(machine)
            except ProtocolError as error:
                self._source.problem((section, name, *error.at), str(error))
                continue
            assert isinstance(component, role)  # noqa: S101 - an offer of this role
            built[name] = component
        return built

    def _at(self, place: Place) -> object:
        node = self._source.data
        for step in place:
            if isinstance(node, list) and isinstance(step, int):
                node = node[step] if step < len(node) else None
            else:
                node = node.get(step) if isinstance(node, dict) else None
        return node


def _elsewhere(machine: object, folder: Path) -> tuple[Place, str] | None:
    """Return which file of a machine, or what it uses, is not in the study's folder, and why not.

    Files that come with labcrane are in its own folder.
    """
    described = isinstance(machine, Mapping)
    place: Place = ("urdf",) if described else ()
    name = machine.get("urdf") if isinstance(machine, Mapping) else machine
    if not isinstance(name, str) or not (described or name.endswith(YAML)):
        return None
    for path in (folder / name, *used(folder / name)):
        if why := outside(path, folder):
            return place, f"{named(('machine', *place))} is {name!r}, and {why}"
    return None
