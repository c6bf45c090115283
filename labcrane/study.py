"""A study: a protocol that has been checked, with everything it refers to."""

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from labcrane.errors import PluginError, ProtocolError
from labcrane.machine import Machine
from labcrane.machine_file import find_machine, load_machine
from labcrane.offers import Offer, Settings
from labcrane.protocol import DEFAULT_OPERATOR, Protocol, Use, read
from labcrane.registry import Registry
from labcrane.roles import (
    Component,
    Controller,
    Cue,
    Dynamics,
    Feedback,
    InputDevice,
    Questionnaire,
    Task,
)
from labcrane.yaml_file import Place, YamlFile

RoleT = TypeVar("RoleT", bound=Component)


@dataclass(frozen=True, slots=True)
class Choice:
    """A component that a protocol names, and its settings."""

    name: str
    plugin: str
    offer: Offer[Component]
    settings: Settings

    def build(self, machine: Machine) -> Component:
        """Build, but do not open, the component."""
        return self.offer.build(self.settings, machine)


@dataclass(frozen=True)
class Study:
    """Everything that a run of a protocol needs.

    Attributes
    ----------
    path, text, sha256
        The protocol file, its content, and the content's hash.
    protocol
        What it says.
    machine, machine_text
        What is operated, and its file's content.
    input, operator, scheme, dynamics
        The components chosen; ``operator`` takes the place of ``input`` in a simulation.
    tasks
        The tasks by the protocol's names for them, built.
    questionnaires
        The questionnaires by the study's names for them, built.
    cues, sounds, views
        What presents the session to people, by the protocol's names: cues and sounds are switched
        on block by block, views are always there.
    """

    path: Path
    text: str
    protocol: Protocol
    machine: Machine
    machine_text: str
    input: Choice
    operator: Choice
    scheme: Choice
    dynamics: Choice
    tasks: Mapping[str, Task]
    task_choices: Mapping[str, Choice]
    questionnaires: Mapping[str, Questionnaire] = field(default_factory=dict)
    questionnaire_choices: Mapping[str, Choice] = field(default_factory=dict)
    cues: dict[str, Choice] = field(default_factory=dict)
    sounds: dict[str, Choice] = field(default_factory=dict)
    views: dict[str, Choice] = field(default_factory=dict)

    @property
    def sha256(self) -> str:
        """Hash of the protocol's text, hexadecimal."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def check_participant(self, participant: str) -> None:
        """Raise :class:`ProtocolError` unless ``participant`` matches the protocol's pattern."""
        pattern = self.protocol.participants.pattern
        if not re.fullmatch(pattern, participant):
            raise ProtocolError(
                f"participant {participant!r} does not match the protocol's pattern {pattern!r}"
            )

    def check_session(self, number: int) -> None:
        """Raise :class:`ProtocolError` unless the protocol has session ``number``."""
        names = [session.name for session in self.protocol.sessions]
        if not 1 <= number <= len(names):
            listed = ", ".join(f"{at} {name!r}" for at, name in enumerate(names, start=1))
            raise ProtocolError(f"there is no session {number}; {self.path} has {listed}")


class StudyReader:
    """Checks a protocol against what is installed, and collects every mistake."""

    def __init__(self, source: YamlFile, registry: Registry) -> None:
        self._source = source
        self._registry = registry

    def choose(self, role: type[RoleT], place: Place, default: Use | None = None) -> Choice | None:
        """Return the component that the protocol uses at ``place``, or note why there is none."""
        written = self._at(place)
        if written is None and default is not None:
            use = default
        elif isinstance(written, dict) and isinstance(written.get("use"), str):
            use = Use.model_validate(written)
        else:
            return None  # noted by the protocol's own check
        try:
            offer = self._registry.find(role, use.use)
        except PluginError as error:
            self._source.problem((*place, "use"), str(error))
            return None
        settings = self._source.check(offer.settings, place, use.settings)
        plugin = self._registry.plugins[role][use.use]
        return Choice(use.use, plugin, offer, settings) if settings is not None else None

    def choose_tasks(self) -> dict[str, Choice]:
        """Return the tasks that can be chosen, by the protocol's names for them."""
        written = self._at(("tasks",))
        names = written if isinstance(written, dict) else {}
        chosen = {name: self.choose(Task, ("tasks", name)) for name in names}
        return {name: choice for name, choice in chosen.items() if choice}

    def choose_questionnaires(self, protocol: Protocol) -> dict[str, Choice]:
        """Return the questionnaires that the protocol asks, noting those that there are not."""
        chosen = {
            name: self.choose(Questionnaire, ("questionnaires", name))
            for name in protocol.questionnaires
        }
        for place, name in self._asked(protocol):
            if name not in chosen:
                chosen[name] = self._by_its_own_name(place, name)
        return {name: choice for name, choice in chosen.items() if choice}

    def _asked(self, protocol: Protocol) -> Iterator[tuple[Place, str]]:
        for number, session in enumerate(protocol.sessions):
            for at, step in enumerate(session.steps):
                place: Place = ("sessions", number, "steps", at)
                for name in (*step.questionnaires, *(step.block.ask if step.block else ())):
                    yield place, name
        for number, rule in enumerate(protocol.stop_rules):
            yield ("stop_rules", number, "questionnaire"), rule.questionnaire

    def _by_its_own_name(self, place: Place, name: str) -> Choice | None:
        try:
            offer = self._registry.find(Questionnaire, name)
        except PluginError as error:
            self._source.problem(place, str(error))
            return None
        settings = self._source.check(offer.settings, place, {})
        plugin = self._registry.plugins[Questionnaire][name]
        return Choice(name, plugin, offer, settings) if settings is not None else None

    def build_questionnaires(
        self, choices: Mapping[str, Choice], machine: Machine
    ) -> dict[str, Questionnaire]:
        """Return the built questionnaires, noting those that cannot be asked as written."""
        built: dict[str, Questionnaire] = {}
        for name, choice in choices.items():
            try:
                questionnaire = choice.build(machine)
            except ProtocolError as error:
                self._source.problem(("questionnaires", name), str(error))
                continue
            assert isinstance(questionnaire, Questionnaire)  # noqa: S101 - an offer of this role
            built[name] = questionnaire
        return built

    def check_stop_rules(self, protocol: Protocol, asked: Mapping[str, Questionnaire]) -> None:
        """Note stop rules on scores that a questionnaire does not have."""
        for number, rule in enumerate(protocol.stop_rules):
            questionnaire = asked.get(rule.questionnaire)
            scores = [score.name for score in questionnaire.scores] if questionnaire else []
            if questionnaire and rule.score not in scores:
                self._source.problem(
                    ("stop_rules", number, "score"),
                    f"{rule.questionnaire} has no score {rule.score!r}; "
                    f"it has {', '.join(scores) or 'none'}",
                )

    def choose_feedback(self) -> tuple[dict[str, Choice], dict[str, Choice], dict[str, Choice]]:
        """Return cues, sounds and views by the protocol's names for them."""
        cues, sounds = {}, {}
        written = self._at(("feedback",))
        for name, use in (written if isinstance(written, dict) else {}).items():
            is_cue = isinstance(use, dict) and use.get("use") in self._registry.offers[Cue]
            place = ("feedback", name)
            if is_cue and (choice := self.choose(Cue, place)):
                cues[name] = choice
            elif not is_cue and (choice := self.choose(Feedback, place)):
                sounds[name] = choice
        written = self._at(("views",))
        names = written if isinstance(written, dict) else {}
        views = {name: self.choose(Feedback, ("views", name)) for name in names}
        for name in set(names) & {*cues, *sounds}:
            self._source.problem(("views", name), f"{name!r} is the name of a feedback already")
        return cues, sounds, {name: choice for name, choice in views.items() if choice}

    def check_groups(self, protocol: Protocol) -> None:
        """Note groups, and blocks, that are given feedback that there is not."""
        for group, names in protocol.design.groups.items():
            self._feedback_exists(("design", "groups", group), names, protocol)
        for number, session in enumerate(protocol.sessions):
            steps = self._source.data["sessions"][number]["steps"]
            for at, step in enumerate(session.steps):
                if step.block is None:
                    continue
                place: Place = ("sessions", number, "steps", at, next(iter(steps[at])), "feedback")
                if step.block.feedback == "group" and not protocol.design.groups:
                    self._source.problem(place, "feedback is by group, but design has no groups")
                elif isinstance(step.block.feedback, tuple):
                    self._feedback_exists(place, step.block.feedback, protocol)

    def _feedback_exists(self, place: Place, names: Sequence[str], protocol: Protocol) -> None:
        for name in names:
            if name not in protocol.feedback:
                known = ", ".join(protocol.feedback) or "none"
                self._source.problem(place, f"there is no feedback {name!r}; there is {known}")

    def machine(self) -> tuple[Machine, str] | None:
        """Return the machine and its file's text, or note what is wrong."""
        name, folder = self._at(("machine",)), self._source.path.parent
        if not isinstance(name, str):
            return None
        try:
            machine = load_machine(name, folder)
            return machine, find_machine(name, folder).read_text(encoding="utf-8")
        except ProtocolError as error:
            self._source.problem(("machine",), str(error))
            return None

    def build(self, choices: Mapping[str, Choice], machine: Machine) -> dict[str, Task]:
        """Return the built tasks, noting those that cannot be done with ``machine``."""
        tasks: dict[str, Task] = {}
        for name, choice in choices.items():
            try:
                task = choice.build(machine)
            except ProtocolError as error:
                self._source.problem(("tasks", name), str(error))
                continue
            assert isinstance(task, Task)  # noqa: S101 - an offer of this role
            tasks[name] = task
        return tasks

    def _at(self, place: Place) -> object:
        node = self._source.data
        for step in place:
            node = node.get(step) if isinstance(node, dict) else None
        return node

    def check_blocks(self, protocol: Protocol, tasks: Mapping[str, Task]) -> None:
        """Note blocks that name no task, or limit what the task does not vary."""
        for number, session in enumerate(protocol.sessions):
            steps = self._source.data["sessions"][number]["steps"]
            for at, step in enumerate(session.steps):
                if step.block is None:
                    continue
                place: Place = ("sessions", number, "steps", at, next(iter(steps[at])))
                if step.block.task not in protocol.tasks:
                    known = ", ".join(protocol.tasks)
                    self._source.problem(
                        (*place, "task"), f"there is no task {step.block.task!r}; there is {known}"
                    )
                elif task := tasks.get(step.block.task):
                    self._limits(place, step.block.limits, task)

    def _limits(self, place: Place, limits: Mapping[str, object], task: Task) -> None:
        factors = task.factors()
        for factor, count in limits.items():
            if factor not in factors:
                message = f"{factor!r} is nothing the task varies; it varies {', '.join(factors)}"
            elif not (isinstance(count, int) and 1 <= count <= len(factors[factor])):
                message = f"{factor} is {count!r}; it must be 1 to {len(factors[factor])}"
            else:
                continue
            self._source.problem((*place, factor), message)

    def check_order(self, protocol: Protocol, tasks: Mapping[str, Task]) -> None:
        """Note ordered factors that no task has."""
        known = {factor for task in tasks.values() for factor in task.factors()}
        for factor in protocol.design.order:
            if factor not in known:
                message = f"no task varies {factor!r}; they vary {', '.join(sorted(known))}"
                self._source.problem(("design", "order", factor), message)


def load(path: Path, registry: Registry) -> Study:
    """Read and check a protocol.

    Components are checked even when other parts of the file are wrong, so that one look at the
    messages is enough.

    Raises
    ------
    ProtocolError
        With one line for every mistake: file, line, what was written, what is possible.
    """
    protocol, source = read(path)
    reader = StudyReader(source, registry)
    machine = reader.machine()
    device = reader.choose(InputDevice, ("input",))
    operator = reader.choose(InputDevice, ("operator",), DEFAULT_OPERATOR)
    scheme = reader.choose(Controller, ("scheme",))
    dynamics = reader.choose(Dynamics, ("dynamics",))
    choices = reader.choose_tasks()
    tasks = reader.build(choices, machine[0]) if machine else {}
    asked = reader.choose_questionnaires(protocol) if protocol else {}
    questionnaires = reader.build_questionnaires(asked, machine[0]) if machine else {}
    shown = reader.choose_feedback()
    if protocol is not None:
        reader.check_groups(protocol)
        reader.check_blocks(protocol, tasks)
        reader.check_stop_rules(protocol, questionnaires)
        if len(tasks) == len(protocol.tasks):
            reader.check_order(protocol, tasks)
    source.raise_problems()
    if not (protocol and machine and device and operator and scheme and dynamics):
        raise AssertionError("a missing part is a problem, and problems were raised")
    return Study(
        path,
        source.text,
        protocol,
        *machine,
        device,
        operator,
        scheme,
        dynamics,
        tasks,
        choices,
        questionnaires,
        asked,
        *shown,
    )
