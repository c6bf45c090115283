"""A study: a protocol that has been checked, with everything it refers to."""

import hashlib
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeGuard

from labcrane.analysis.tables.definitions import MEASURES, OF_ASSISTANCE
from labcrane.core.records import Value
from labcrane.core.roles import (
    Capture,
    Controller,
    Dynamics,
    InputDevice,
    Questionnaire,
    SecondaryTask,
    Task,
)
from labcrane.core.settings import EstimateSettings, Settings
from labcrane.errors import ProtocolError, meant, nearest
from labcrane.files.complaints import written
from labcrane.files.names import check_name
from labcrane.files.yaml import Place, YamlFile
from labcrane.machines.machine import Machine
from labcrane.protocol.components import ComponentResolver, ComponentSpec
from labcrane.protocol.design import CONDITION, Switch
from labcrane.protocol.protocol import (
    ASSIST,
    DEFAULT_OPERATOR,
    OF_ASSIST,
    Protocol,
    read,
)
from labcrane.protocol.references import Parts, ReferenceChecker, twice
from labcrane.protocol.steps import Block
from labcrane.protocol.tracks import Track
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.own_streams import OWN_STREAMS, STATED
from labcrane.registry.call_monitor import CallMonitor
from labcrane.registry.registry import Registry

ESTIMATES = "estimates."
"""How the parts begin that a study's estimates play."""


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
    choices
        All components but the operator, by the part they play: ``scheme``, ``tasks.NAME``.
    tasks, task_choices
        The tasks by the protocol's names for them, built, with the secondary tasks beside them.
    secondary
        What runs beside the tasks, by the protocol's names.
    questionnaires, questionnaire_choices
        The questionnaires by the study's names for them, built, and what they are built from.
    cues, sounds, views
        What presents the session to people, by the protocol's names: cues and sounds are switched
        on block by block, views are always there.
    monitors
        Monitors of the signals of streams; None for all that are installed.
    recordings
        Cameras, microphones and screens that are recorded, by the protocol's names.
    call_monitor
        Watches over all components that are built.
    recorded
        Whether it was read as the record of what was run.
    beyond_operator
        Places that name axes and buttons of the input that the operator does not have.
    outdated
        Settings that would be refused today, of a session that continues as it was begun.
    answers
        Answers of a simulated participant, by questionnaire and item; the rest is sampled.
    source
        The protocol's file, which knows the line of everything.
    """

    path: Path
    text: str
    protocol: Protocol
    machine: Machine
    machine_text: str
    input: ComponentSpec
    operator: ComponentSpec
    scheme: ComponentSpec
    dynamics: ComponentSpec
    choices: Mapping[str, ComponentSpec]
    tasks: Mapping[str, Task]
    task_choices: Mapping[str, ComponentSpec]
    secondary: dict[str, ComponentSpec] = field(default_factory=dict)
    questionnaires: Mapping[str, Questionnaire] = field(default_factory=dict)
    questionnaire_choices: Mapping[str, ComponentSpec] = field(default_factory=dict)
    cues: dict[str, ComponentSpec] = field(default_factory=dict)
    sounds: dict[str, ComponentSpec] = field(default_factory=dict)
    views: dict[str, ComponentSpec] = field(default_factory=dict)
    monitors: dict[str, ComponentSpec] | None = None
    recordings: dict[str, ComponentSpec] = field(default_factory=dict)
    call_monitor: CallMonitor = field(default_factory=CallMonitor)
    recorded: bool = False
    beyond_operator: tuple[tuple[Place, str], ...] = ()
    outdated: str = ""
    answers: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    source: YamlFile | None = field(default=None, repr=False, compare=False)

    @property
    def sha256(self) -> str:
        """Hash of the protocol's text, hexadecimal."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def written(self) -> Mapping[str, object]:
        """Top level of the protocol's file, as it is written; empty for a record."""
        return self.source.data if self.source else {}

    @property
    def estimates(self) -> Mapping[str, EstimateSettings]:
        """Settings of the estimates, by the protocol's names."""
        return _estimates(self.choices)

    def window_title(self, view: str) -> str:
        """Return the title of a view's window."""
        return f"labcrane: {view} - {self.protocol.study}"

    def where(self, place: Place) -> str:
        """Return file, line and column of what the protocol has at ``place``."""
        return self.source.where(place) if self.source else str(self.path)

    def check_installed(self, *, simulated: bool = False, feedback: bool = True) -> None:
        """Raise :class:`ProtocolError` unless all that a run of the study needs is installed.

        Parameters
        ----------
        simulated
            Whether the simulated operator takes the place of the input.
        feedback
            Whether views and sounds are shown, and recordings made.
        """
        used = {**self.choices} | ({"input": self.operator} if simulated else {})
        if not feedback:
            shown = ("feedback.", "views.", "recordings.")
            used = {part: each for part, each in used.items() if not part.startswith(shown)}
        lacks = {each.called: each.offer.missing for each in used.values()}
        if wrong := [f"{called} {what}" for called, what in lacks.items() if what]:
            raise ProtocolError("\n".join(wrong))

    def check_participant(self, participant: str) -> None:
        """Raise :class:`ProtocolError` unless ``participant`` matches the protocol's pattern."""
        pattern = self.protocol.participants.pattern
        if not re.fullmatch(pattern, participant):
            if re.fullmatch(pattern, DataFolder.pseudonym(participant)):
                raise ProtocolError(
                    f"{participant!r} is the name of a folder with recordings; write "
                    f"{DataFolder.options(participant)}"
                )
            raise ProtocolError(
                # As it stands in the file, where a backslash is one backslash.
                f"participant {participant!r} does not match the protocol's pattern '{pattern}'; "
                "give the pseudonym as it was handed out, or correct participants: pattern:"
            )
        if not self.recorded:
            check_name(participant, "participant")

    def check_session(self, number: int) -> None:
        """Raise :class:`ProtocolError` unless the protocol has session ``number``."""
        names = [session.name for session in self.protocol.sessions]
        if not 1 <= number <= len(names):
            listed = ", ".join(f"{at} {name!r}" for at, name in enumerate(names, start=1))
            raise ProtocolError(f"there is no session {number}; {self.path} has {listed}")


MOST_TRIALS = 100_000
"""Of a block."""


def trials_of(block: Block, protocol: Protocol, task: Task) -> tuple[float, float]:
    """Return about how many trials a block has, and how long they take in s, without a plan."""
    share = float(block.repeat * (block.until.rounds if block.until else 1))
    track = protocol.design.tracks.get(block.track)
    if track is not None and track.factor == ASSIST:
        share *= track.rounds
    for factor, levels in task.factors().items():
        if track is not None and factor == track.factor:
            share *= track.rounds / len(levels)
            continue
        times = protocol.design.order[factor].times if factor in protocol.design.order else 1
        used = block.limits.get(factor)
        share *= times if not isinstance(used, int) else min(used / len(levels), times)
    once = task.plan(task.factors())
    return len(once) * share, sum(trial.expected_s for trial in once) * share


def factors_of(task: Task, protocol: Protocol) -> dict[str, Sequence[str]]:
    """Return the levels of each factor that a track can choose: the task's, and the shares."""
    levels = protocol.assist.levels if protocol.assist else {}
    return {**task.factors(), **({ASSIST: tuple(levels)} if levels else {})}


NO_CONDITIONS = (
    "design has no conditions; write them under design:, with the feedback of each, as conditions: "
    "{plain: none, helped: all}"
)
NO_GROUPS = (
    "feedback is by group, but design has no groups; write them under design:, or feedback: all, "
    "none or a list of names"
)


class Checker:
    """Notes names and numbers in a protocol that its parts do not have."""

    def __init__(self, source: YamlFile, protocol: Protocol) -> None:
        self._source = source
        self._protocol = protocol

    def check(self, tasks: Mapping[str, Task], asked: Mapping[str, Questionnaire]) -> None:
        """Note every such mistake, given the tasks and questionnaires that could be built."""
        self._check_feedback()
        self._check_blocks(tasks)
        if len(tasks) == len(self._protocol.tasks):
            self._check_order(tasks)
        self._check_conditions(tasks)
        self._check_blocks_of_conditions()
        self._check_stop_rules(asked)
        if self._source.recorded:
            return  # what follows changes nothing of what was run, and was once accepted
        if len(tasks) == len(self._protocol.tasks):
            self._check_primary(tasks)
        self._check_names()
        self._check_own_streams()
        self._check_sensors()
        self._check_windows()
        if self._protocol.participants.ends_early:
            self._source.problem(
                ("participants", "pattern"),
                f"participants.pattern '{self._protocol.participants.pattern}' matches no name; "
                "remove ^ and $, which match only the beginning and the end of a name",
            )

    def _check_names(self) -> None:
        """Note two sessions of one name."""
        names = [session.name for session in self._protocol.sessions]
        for name in twice(names):
            number = len(names) - 1 - names[::-1].index(name)
            message = f"two sessions are called {name!r}; give each a name of its own"
            self._source.problem(("sessions", number, "name"), message)

    def _check_own_streams(self) -> None:
        """Note streams of labcrane's own that no part of the study sends."""
        views, sent = self._protocol.views, [*self._protocol.feedback, *self._protocol.views]
        known = [*OWN_STREAMS, *(f"labcrane.pictures.{view}" for view in views)]
        for label, need in self._protocol.streams.items():
            name = need.name or ""
            of = name.removeprefix("labcrane.feedback.").split(".")[0]
            if not name.startswith("labcrane.") or name in known or of in sent:
                continue
            there = nearest(
                name, [*known, *(f"labcrane.feedback.{each}" for each in sent)], "it has"
            )
            message = f"labcrane sends no stream {name!r}; {there}"
            self._source.problem(("streams", label, "name"), message)

    def _check_windows(self) -> None:
        """Note recordings of a view that there is not."""
        views = self._protocol.views
        for name, use in self._protocol.recordings.items():
            of = dict(use).get("of")
            if of is not None and of not in views:
                message = f"there is no view {of!r}; {nearest(of, views, 'there is')}"
                self._source.problem(("recordings", name, "of"), message)

    def _check_sensors(self) -> None:
        """Note sensors at a view or sound that there is not, or at a view without a patch."""
        views = self._protocol.views
        shown = [*self._protocol.feedback, *views]
        sensors: list[tuple[Place, str]] = [
            (("streams", label, "sees", channel), of)
            for label, need in self._protocol.streams.items()
            for channel, of in need.sees.items()
        ]
        sensors += [
            (("recordings", name, "sees"), dict(use)["sees"])
            for name, use in self._protocol.recordings.items()
            if "sees" in dict(use)
        ]
        for place, of in sensors:
            if of not in shown:
                message = f"there is no view or feedback {of!r}; {nearest(of, shown, 'there is')}"
            elif of in views and "patch" not in dict(views[of]):
                message = f"view {of!r} has no patch for a photodiode; write patch: {{}} under it"
            else:
                continue
            self._source.problem(place, message)

    def _check_blocks(self, tasks: Mapping[str, Task]) -> None:
        """Note blocks that name no task, or limit what the task does not vary."""
        for place, block in self._blocks():
            if block.task not in self._protocol.tasks:
                there = nearest(block.task, self._protocol.tasks, "there is")
                message = f"there is no task {block.task!r}; {there}"
                self._source.problem((*place, "task"), message)
            elif task := tasks.get(block.task):
                if block.track and not self._track(place, block, task):
                    continue
                self._limits(place, block.limits, task)
                self._count(place, block, task)

    def _check_primary(self, tasks: Mapping[str, Task]) -> None:
        """Note primary outcomes that no task and no measure gives."""
        given = [
            column
            for task in tasks.values()
            for signal in task.results
            for column in signal.columns
        ]
        known = [*dict.fromkeys([*given, *MEASURES])]
        for number, name in enumerate(self._protocol.design.primary):
            if name in OF_ASSISTANCE and self._protocol.assist is None:
                message = f"{name} needs an assistant; add assist:, or drop it"
                self._source.problem(("design", "primary", number), message)
            elif name not in known:
                message = f"there is no outcome {name!r}; {nearest(name, known, 'there is')}"
                self._source.problem(("design", "primary", number), message)

    def _track(self, place: Place, block: Block, task: Task) -> bool:
        """Note mistakes of a block's track, for its task; return whether there are none."""
        tracks = self._protocol.design.tracks
        track = tracks.get(block.track)
        if track is None:
            there = nearest(block.track, tracks, "there is")
            self._source.problem((*place, "track"), f"there is no track {block.track!r}; {there}")
            return False
        at: Place = ("design", "tracks", block.track)
        factors = factors_of(task, self._protocol)
        if track.factor not in factors:
            there = nearest(track.factor, factors, "it varies")
            message = f"task {block.task!r} does not vary {track.factor!r}; {there}"
            self._source.problem((*at, "factor"), message)
            return False
        if track.factor in block.limits:
            message = f"track {block.track!r} chooses {track.factor}; drop the limit"
            self._source.problem((*place, track.factor), message, key=True)
            return False
        levels = factors[track.factor]
        if unknown := [name for name in track.levels if name not in levels]:
            for name in unknown:
                message = f"{track.factor} has no level {name!r}; {nearest(name, levels, 'it has')}"
                self._source.problem((*at, "levels", name), message, key=True)
            return False
        results = [column for signal in task.results for column in signal.columns]
        if track.measure and track.measure not in results:
            there = nearest(track.measure, results, "it has")
            message = f"task {block.task!r} has no result {track.measure!r}; {there}"
            self._source.problem((*at, "measure"), message)
            return False
        units = {column: s.unit for s in task.results for column in s.columns}
        if units.get(track.measure) == "s" and track.at_most is not None and track.at_most <= 0.0:
            message = (
                f"at_most is {track.at_most:g} s, and {track.measure} is a time, so that no trial "
                "is a success; it must be greater than 0 s"
            )
            self._source.problem((*at, "at_most"), message)
            return False
        return self._alike(at, track, task)

    def _alike(self, at: Place, track: Track, task: Task) -> bool:
        """Note levels with other trials than the first: a round would not be a round."""
        if track.factor == ASSIST:
            return True  # the same trials at each share
        made = {
            level: [each.counted for each in task.plan({**task.factors(), track.factor: (level,)})]
            for level in track.levels
        }
        first, *others = made
        odd = [level for level in others if made[level] != made[first]]
        for level in odd:
            message = (
                f"level {level!r} makes {len(made[level])} trials and {first!r} makes "
                f"{len(made[first])}; a track needs levels that make as many"
            )
            self._source.problem((*at, "levels", level), message, key=True)
        return not odd

    def _blocks(self) -> Iterator[tuple[Place, Block]]:
        for number, session in enumerate(self._protocol.sessions):
            steps = self._source.data["sessions"][number]["steps"]
            for at, step in enumerate(session.steps):
                if step.block is not None:
                    yield ("sessions", number, "steps", at, next(iter(steps[at]))), step.block

    def _count(self, place: Place, block: Block, task: Task) -> None:
        """Note a block with more trials than the limit."""
        count = trials_of(block, self._protocol, task)[0]
        if count > MOST_TRIALS and not self._source.recorded:
            message = f"the block has {count:.0f} trials; the maximum is {MOST_TRIALS}: repeat less"
            self._source.problem(place, message)

    def _limits(self, place: Place, limits: Mapping[str, object], task: Task) -> None:
        factors = task.factors()
        for factor, count in limits.items():
            if factor not in factors:
                close = meant(factor, [*Block.model_fields, *factors])
                listed = ", ".join(factors) or "nothing"
                there = f"{close} it varies {listed}".lstrip()
                message = f"{factor!r} is not a key of a block or a factor of the task; {there}"
            elif not (self._is_count(count) and 1 <= count <= len(factors[factor])):
                most = len(factors[factor])
                message = f"{factor} is {written(count)}; it must be a whole number, 1 to {most}"
            else:
                continue
            self._source.problem((*place, factor), message, key=factor not in factors)

    def _is_count(self, count: object) -> TypeGuard[int]:
        """Whether a number is whole; ``true``, which Python takes for 1, is so in old records."""
        return isinstance(count, int) and (self._source.recorded or not isinstance(count, bool))

    def _check_order(self, tasks: Mapping[str, Task]) -> None:
        """Note ordered factors that no task has, or whose levels cannot come in that order."""
        known = {factor for task in tasks.values() for factor in task.factors()}
        for factor in self._protocol.design.order:
            if factor == CONDITION:
                continue  # its own check
            if factor not in known:
                message = (
                    f"no task varies {factor!r}; {nearest(factor, sorted(known), 'they vary')}"
                )
                self._source.problem(("design", "order", factor), message, key=True)
        if self._source.recorded:
            return
        for name, task in tasks.items():
            for factor, levels in task.factors().items():
                order = self._protocol.design.order.get(factor)
                if order and (why := order.why_not(len(levels))):
                    place = ("design", "order", factor, "in_a_row")
                    self._source.problem(place, f"{factor} of task {name!r} has {why}")

    def _check_conditions(self, tasks: Mapping[str, Task]) -> None:
        """Note conditions whose feedback, order or column of the trial table there cannot be."""
        design, at = self._protocol.design, ("design", "order", CONDITION)
        order = design.order.get(CONDITION)
        if order and not (
            design.conditions or any(CONDITION in t.factors() for t in tasks.values())
        ):
            self._source.problem(at, NO_CONDITIONS, key=True)
        elif order and design.conditions and (why := order.why_not(len(design.conditions))):
            self._source.problem((*at, "in_a_row"), f"{CONDITION} has {why}")
        for name, task in tasks.items() if design.conditions else ():
            if any(CONDITION in trial.condition for trial in task.plan(task.factors())):
                message = (
                    f"task {name!r} has a {CONDITION} of its own, and design has conditions; both "
                    "would be one column of the trial table: drop one of them"
                )
                self._source.problem(("tasks", name), message)

    def _check_blocks_of_conditions(self) -> None:
        """Note blocks of conditions that there are not, or with feedback of their own."""
        design = self._protocol.design
        for place, block in self._blocks():
            if block.condition is None:
                continue
            if not design.conditions:
                message = NO_CONDITIONS
            elif block.condition > design.positions:
                message = (
                    f"condition is {block.condition}, and each participant has {design.positions} "
                    f"of {', '.join(design.conditions)}; write 1 to {design.positions}"
                )
            elif "feedback" in block.model_fields_set:
                message = (
                    "the block has a condition, which says which feedback is on, and feedback; "
                    "drop one of them"
                )
            else:
                continue
            self._source.problem((*place, CONDITION), message)

    def _check_stop_rules(self, asked: Mapping[str, Questionnaire]) -> None:
        """Note stop rules on scores that a questionnaire does not have."""
        for number, rule in enumerate(self._protocol.stop_rules):
            questionnaire = asked.get(rule.questionnaire or "")
            scores = [score.name for score in questionnaire.scores] if questionnaire else []
            if questionnaire and rule.score not in scores:
                self._source.problem(
                    ("stop_rules", number, "score"),
                    f"{rule.questionnaire} has no score {rule.score!r}; "
                    f"{nearest(str(rule.score), scores, 'it has')}",
                )

    def _check_feedback(self) -> None:
        """Note groups, conditions and blocks that are given feedback that there is not."""
        for group, names in self._protocol.design.groups.items():
            self._feedback_exists(("design", "groups", group), names)
        switches: dict[Place, Switch] = {
            ("design", "conditions", name): switch
            for name, switch in self._protocol.design.conditions.items()
        }
        switches |= {
            (*place, "feedback"): block.feedback
            for place, block in self._blocks()
            if block.condition is None
        }
        groups = {
            ("design", "groups", name): on for name, on in self._protocol.design.groups.items()
        }
        self._check_shares(groups | switches)
        for at, switch in switches.items():
            if switch == "group" and not self._protocol.design.groups:
                self._source.problem(at, NO_GROUPS)
            elif isinstance(switch, tuple):
                self._feedback_exists(at, switch)

    def _check_shares(self, switches: Mapping[Place, Switch]) -> None:
        """Note what switches on more shares of the assistant than a trial has."""
        shares = self._protocol.assist.levels if self._protocol.assist else {}
        tracks = self._protocol.design.tracks
        tracked = {
            (*place, "feedback")
            for place, block in self._blocks()
            if block.track in tracks and tracks[block.track].factor == ASSIST
        }
        for place, block in self._blocks():
            of_condition = (*place, "feedback") in tracked and block.condition is not None
            given = self._protocol.design.conditions.values() if of_condition else ()
            if any(on == "all" or (on != "none" and set(on) & set(shares)) for on in given):
                message = "a track chooses the share of assist here, and conditions switch shares "
                message += "on as well; remove one of both"
                self._source.problem((*place, "condition"), message)
        for at, switch in switches.items():
            names = self._protocol.switched if switch == "all" else switch
            on = [name for name in names if name in shares]
            if len(on) > (0 if at in tracked else 1):
                chosen = "and its track chooses the share" if at in tracked else "of one trial"
                message = (
                    f"feedback switches on {', '.join(on)}, shares of assist, {chosen}; list what "
                    "is on, with one share at most, or none where a track chooses it"
                )
                self._source.problem(at, message)

    def _feedback_exists(self, place: Place, names: Sequence[str]) -> None:
        for at, name in enumerate(names):
            if name not in self._protocol.switched:
                there = nearest(name, self._protocol.switched, "there is")
                self._source.problem((*place, at), f"there is no feedback {name!r}; {there}")


def _estimates(choices: Mapping[str, ComponentSpec]) -> dict[str, EstimateSettings]:
    """Return the settings of the estimates, by the protocol's names."""
    return {
        part.removeprefix(ESTIMATES): choice.settings
        for part, choice in choices.items()
        if part.startswith(ESTIMATES) and isinstance(choice.settings, EstimateSettings)
    }


def _check_estimates(
    source: YamlFile,
    protocol: Protocol,
    estimates: Mapping[str, EstimateSettings],
    taken: Container[str],
) -> None:
    """Note estimates with a name that is taken or wrong, or without a stream."""
    single = [label for label, each in protocol.streams.items() if not each.several]
    for name, settings in estimates.items():
        if not name.isidentifier():
            message = f"{name!r} names columns; give a word of letters, digits and underscores"
            source.problem(("estimates", name), message, key=True)
        if own := {"time", "state", "first", "last", *STATED} & set(settings.values):
            message = f"{', '.join(sorted(own))} names a column of every estimate; rename the value"
            source.problem(("estimates", name, "use"), message)
        if name in taken:
            message = f"{name!r} is already the name of a secondary task"
            source.problem(("estimates", name), message, key=True)
        if settings.stream not in single:
            there = nearest(settings.stream, single, "streams has")
            message = f"there is no single stream {settings.stream!r} under streams; {there}"
            source.problem(("estimates", name, "stream"), message)


def _with_beside(
    chooser: ComponentResolver,
    tasks: Mapping[str, Task],
    secondary: Mapping[str, ComponentSpec],
    estimates: Mapping[str, EstimateSettings],
    machine: Machine,
) -> dict[str, Task]:
    """Return the tasks with what runs beside them; each has its own, which is opened once."""
    from labcrane.protocol.beside import Beside  # noqa: PLC0415 - it loads numpy
    from labcrane.protocol.estimated import trial_means  # noqa: PLC0415

    built = {name: chooser.build(SecondaryTask, "secondary", secondary, machine) for name in tasks}
    return {
        name: Beside(task, built[name] | trial_means(estimates), estimates)
        for name, task in tasks.items()
    }


def _sections(protocol: Protocol) -> dict[Place, Settings]:
    """Return the parts of a protocol that belong to no component, by their place."""
    sections: dict[Place, Settings] = {("page",): protocol.page}
    if protocol.assist:
        sections[(ASSIST,)] = protocol.assist
    return sections | {("stop_rules", at): rule for at, rule in enumerate(protocol.stop_rules)}


def load(path: Path, registry: Registry, *, recorded: bool = False) -> Study:
    """Read and check a protocol.

    Components are checked even when other parts of the file are wrong, so that one look at the
    messages is enough.

    Parameters
    ----------
    recorded
        Whether it has been run: it was accepted by the rules of its day, and rules that only judge
        are not held against it; what its components refer to was there, and is not looked up again.

    Raises
    ------
    ProtocolError
        With one line for every mistake: file, line, what was written, what is possible.
    """
    protocol, source = read(path, recorded=recorded)
    chooser = ComponentResolver(source, registry)
    machine = chooser.machine()
    device = chooser.choose(InputDevice, ("input",))
    operator = chooser.choose(InputDevice, ("operator",), DEFAULT_OPERATOR)
    scheme = chooser.choose(Controller, ("scheme",))
    assist = chooser.choose(InputDevice, (ASSIST,), beside=OF_ASSIST)
    dynamics = chooser.choose(Dynamics, ("dynamics",))
    choices = chooser.choose_several(Task, "tasks")
    tasks = chooser.build(Task, "tasks", choices, machine[0]) if machine else {}
    cues, sounds, views = chooser.choose_feedback()
    secondary = chooser.choose_several(SecondaryTask, "secondary")
    for name in secondary.keys() & {*cues, *sounds, *views}:
        source.problem(("secondary", name), f"{name!r} is already the name of a feedback", key=True)
    shares = protocol.assist.levels if protocol and protocol.assist else {}
    for name in shares.keys() & {*cues, *sounds, *views, *secondary}:
        message = f"{name!r} is already the name of a feedback or a secondary task"
        source.problem((ASSIST, "share", name), message, key=True)
    others = chooser.choose_others()
    estimates = _estimates(others)
    if (secondary or estimates) and machine:
        tasks = _with_beside(chooser, tasks, secondary, estimates, machine[0])
    asked = chooser.choose_questionnaires(protocol) if protocol else {}
    questionnaires = (
        chooser.build(Questionnaire, "questionnaires", asked, machine[0]) if machine else {}
    )
    if protocol is not None:
        Checker(source, protocol).check(tasks, questionnaires)
    recordings = chooser.choose_several(Capture, "recordings")
    for name in recordings.keys() & (protocol.streams if protocol else {}):
        source.problem(("recordings", name), f"{name!r} is already the name of a stream", key=True)
    monitors = chooser.choose_monitors()
    if protocol is not None:
        _check_estimates(source, protocol, estimates, secondary)
    named: dict[str, Mapping[str, ComponentSpec]] = {
        "tasks": choices,
        "secondary": secondary,
        "questionnaires": asked,
        "feedback": cues | sounds,
        "views": views,
        "monitors": monitors or {},
        "recordings": recordings,
    }
    roles = {"input": device, ASSIST: assist, "scheme": scheme, "dynamics": dynamics}
    there = {part: choice for part, choice in roles.items() if choice}
    there |= {f"{kind}.{name}": each for kind, of in named.items() for name, each in of.items()}
    there |= others
    beyond: tuple[tuple[Place, str], ...] = ()
    if machine and not recorded:
        places: dict[Place, ComponentSpec] = {tuple(p.split(".", 1)): c for p, c in there.items()}
        places |= {("operator",): operator} if operator else {}
        faulty = chooser.but_for_numbers
        sections = _sections(protocol) if protocol else {}
        parts = Parts(machine[0], places | faulty, tasks, sections, {*faulty})
        references = ReferenceChecker(source, parts)
        references.check()
        beyond = tuple(references.beyond_the_operator())
    source.raise_problems()
    if not (protocol and machine and device and operator and scheme and dynamics):
        raise AssertionError("a missing part is a problem, and problems were raised")
    return Study(
        path=path,
        text=source.text,
        protocol=protocol,
        machine=machine[0],
        machine_text=machine[1],
        input=device,
        operator=operator,
        scheme=scheme,
        dynamics=dynamics,
        choices=there,
        tasks=tasks,
        task_choices=choices,
        secondary=secondary,
        questionnaires=questionnaires,
        questionnaire_choices=asked,
        cues=cues,
        sounds=sounds,
        views=views,
        monitors=monitors,
        recordings=recordings,
        call_monitor=chooser.call_monitor,
        recorded=recorded,
        beyond_operator=beyond,
        source=source,
    )
