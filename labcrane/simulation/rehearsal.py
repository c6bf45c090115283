"""Rehearsal: one trial of every block for every group, without people, equipment or a record.

It finds before a session what only running finds: the study's own plugins are built and
called as in a session, in its order, on a clock that does not wait. All other trials of the planned
participants are begun and not run: a scene is placed by the seed of its trial, and can fit for most
of them.

Its load of the loop is processor time: wall time warned about good studies on busy computers.
Hidden views would need graphics on an office computer.
"""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice
from pathlib import Path
from traceback import extract_tb

from labcrane.core.clock import ManualClock
from labcrane.core.records import Event, Frame, Phase, Run, Trial
from labcrane.core.roles import Cue, Task
from labcrane.design.plan import PlannedBlock, PlannedStep, Planner, SessionPlan, plan_session
from labcrane.design.slots import group_of
from labcrane.errors import LabcraneError, ProtocolError
from labcrane.files.pseudonyms import pseudonyms
from labcrane.files.yaml import Place
from labcrane.protocol.components import ComponentSpec
from labcrane.protocol.questions import CheckQuestion
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.recording.frame_log import BatchLog, columns
from labcrane.recording.journal import SessionJournal
from labcrane.registry.call_monitor import promised
from labcrane.registry.proxies import loosely_watched
from labcrane.session import loop
from labcrane.session.commands import Command, Order
from labcrane.session.metadata import context
from labcrane.session.sequencer import Sequencer
from labcrane.session.visit import Visit

PATIENCE_S = 60.0
"""How much longer than expected a trial may take, at least, before it is cut off."""

PATIENCE = 5.0
"""The same, as a multiple of what is expected."""

BREAK_S = 0.1
"""Length of a break in a rehearsal, in seconds."""

HELD = 0.5
"""Share of a tick's time that may go by in what a rehearsal computes: a session also waits for
devices, and sends."""

FEWEST_TICKS = 100
"""Fewest ticks from which the time of one is reported: the first ones are slow."""

MOST_BEGUN = 200
"""Most participants whose trials are begun; more would take long and find little."""

DRAWN = 200
"""Frames of a session that cues are given: whatever they do wrong, they do soon."""


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """Summary of a rehearsal.

    Attributes
    ----------
    sessions, trials
        How many were run.
    questions
        Warnings about them: a trial that no participant could end, or that runs out of time.
    """

    sessions: int
    trials: int
    questions: tuple[CheckQuestion, ...]


def rehearse(study: Study) -> Rehearsed:
    """Run one trial of each block of each session for every group, on the simulated operator.

    Raises
    ------
    ProtocolError
        With a line for whatever would end a session: its message says in which, and in what.
    """
    study.check_installed(simulated=True, feedback=False)
    _build_displays(study)
    questions: dict[str, CheckQuestion] = {}
    wrong: list[str] = []
    sessions = trials = 0
    for name, slot in _one_of_each_group(study):
        for number in range(1, len(study.protocol.sessions) + 1):
            where = f"rehearsal, session {study.protocol.sessions[number - 1].name!r}"
            try:
                whole = plan_session(study, name, number, slot)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
                at = study.where(_unplanned(study, name, number, slot))
                wrong.append(f"{at}: {where}: {_cause(error)}")
                continue
            plan = replace(whole, steps=tuple(_shortened(whole.steps)))
            where += f", group {plan.group!r}" if plan.group else ""
            seen = _Examiner(study, plan)
            sessions += 1
            try:
                _run(study, plan, seen)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
                wrong.append(f"{study.where(seen.place)}: {where}: {_cause(error)}")
                continue
            trials += seen.ended
            for each in seen.questions:
                if each.key not in study.protocol.expected:
                    questions.setdefault(each.key, each)
    wrong = wrong or list(_not_begun(study))
    if wrong:
        raise ProtocolError("\n".join(dict.fromkeys(wrong)))
    return Rehearsed(sessions, trials, tuple(questions.values()))


def _not_begun(study: Study) -> Iterator[str]:
    """Yield which trials of the planned participants cannot begin, one of each kind, and why."""
    for number, session in enumerate(study.protocol.sessions, start=1):
        kinds: set[tuple[int, str]] = set()
        rig = Rig.build(study, simulated=True)
        with loosely_watched((*rig.components, *rig.tasks.values())), rig.opened(study, 0):
            for slot, name in enumerate(planned_names(study), start=1):
                where = f"rehearsal, session {session.name!r}"
                try:
                    plan = plan_session(study, name, number, slot)
                except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
                    at = study.where(_unplanned(study, name, number, slot))
                    yield f"{at}: {where} of {name}: {_cause(error)}"
                    break
                for at, trial, why in _stuck(study, rig, plan, kinds):
                    yield f"{at}: {where}, trial {trial} of {name}: {why}"


def _stuck(
    study: Study, rig: Rig, plan: SessionPlan, kinds: set[tuple[int, str]]
) -> Iterator[tuple[str, int, str]]:
    """Yield where trials of a plan are written that cannot begin, their numbers, and why.

    Trials of the same step and condition as one of ``kinds`` are left out; those found are added.
    """
    for step, block, trial in _trials(plan):
        kind = step.number, repr(trial.planned.condition)
        if kind in kinds:
            continue
        try:
            _begin(rig, rig.tasks[block.task], trial)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
            kinds.add(kind)
            at = study.where(_step(study, plan.number, step.number))
            yield at, trial.number, _cause(error)


def _trials(plan: SessionPlan) -> Iterator[tuple[PlannedStep, PlannedBlock, Trial]]:
    for step in plan.steps:
        if step.block is not None:
            for trial in step.block.trials:
                yield step, step.block, trial


def _begin(rig: Rig, task: Task, trial: Trial) -> None:
    """Begin a trial as a session does."""
    for component in (*rig.components, task):
        component.begin_trial(trial)
    if trial.planned.start_pose is not None:
        rig.dynamics.reset(trial.planned.start_pose)


def planned_names(study: Study) -> Sequence[str]:
    """Return the pseudonyms of the planned participants, at most :data:`MOST_BEGUN` of them."""
    about = study.protocol.participants
    try:
        return pseudonyms(about.pattern, min(about.planned, MOST_BEGUN))
    except ProtocolError:  # which a check asks about
        return ["P001"]


def _step(study: Study, number: int, left: int) -> Place:
    """Return where the protocol has a step, by its number in the plan; the session for 0."""
    session: Place = ("sessions", number - 1)
    if not left:
        return session
    for at, step in enumerate(study.protocol.sessions[number - 1].steps):
        left -= step.planned
        if left <= 0:
            return (*session, "steps", at)
    raise AssertionError("a plan has the steps of its session, each as often as it is written")


def _cause(error: Exception) -> str:
    """Return the text of an error; for one that labcrane did not foresee, its type and place."""
    if isinstance(error, LabcraneError):
        return str(error)
    steps = extract_tb(error.__traceback__)
    at = f" ({Path(steps[-1].filename).name}:{steps[-1].lineno})" if steps else ""
    said = f"{type(error).__name__}: {error}".removesuffix(": ").replace("\n", " ")
    return (
        f"it ends in {said}{at}, which is a fault of labcrane, not of your protocol; report it with"
        " the protocol, and change this part meanwhile"
    )


def _unplanned(study: Study, name: str, number: int, slot: int) -> Place:
    """Return the step of a session that cannot be planned; the session if all can."""
    planner = Planner(study, name, number, slot)
    for at, step in enumerate(study.protocol.sessions[number - 1].steps):
        try:
            list(planner.steps(step))
        except Exception:  # noqa: BLE001 - it was reported; this finds its place
            return ("sessions", number - 1, "steps", at)
    return ("sessions", number - 1)


def _build_displays(study: Study) -> None:
    """Build the views and sounds that are installed; to be opened they need people's devices."""
    wrong = []
    shown = {"views": study.views, "feedback": study.sounds}
    for key, name, choice in ((key, *each) for key, some in shown.items() for each in some.items()):
        if choice.offer.missing:
            continue
        try:
            choice.build(study.machine)
        except LabcraneError as error:
            place = (key, name, *getattr(error, "at", ()))
            wrong.append(f"{study.where(place)}: rehearsal: {error}")
    if wrong:
        raise ProtocolError("\n".join(wrong))


def _one_of_each_group(study: Study) -> Iterator[tuple[str, int]]:
    """Yield a pseudonym and a slot for every group; once for a study without."""
    groups = tuple(study.protocol.design.groups)
    slots: dict[str, int] = {}
    for slot in islice(count(1), max(1, len(groups))):  # each run of slots has every group once
        slots.setdefault(group_of(study.protocol.study, groups, slot), slot)
    for slot in slots.values():
        yield planned_names(study)[0], slot


def _shortened(steps: Sequence[PlannedStep]) -> Iterator[PlannedStep]:
    """Yield the rehearsed part of a session: a trial of each block, in its first repetition."""
    seen: set[tuple[object, ...]] = set()
    for step in steps:
        if step.block is None:
            yield replace(step, seconds=min(step.seconds, BREAK_S))
            continue
        block = step.block
        kind = (
            block.name, block.task, block.practice, block.reference, block.ask, block.condition,
        )  # fmt: skip
        if kind not in seen:
            seen.add(kind)
            yield replace(step, block=replace(block, trials=_until_counted(block.trials)))


def _until_counted(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    """Return the first counted trial, and those that only lead to it."""
    kept: list[Trial] = []
    for trial in trials:
        kept.append(trial)
        if trial.planned.counted:
            break
    return tuple(kept)


class _Examiner:
    """Experimenter of a rehearsal: skips trials that do not end, and remembers them."""

    def __init__(self, study: Study, plan: SessionPlan) -> None:
        self._study, self._number = study, plan.number
        self._blocks = {block.number: block for block in plan.blocks}
        self._rate_hz = study.protocol.rate_hz
        self.sequencer: Sequencer | None = None
        self._patience: float | None = None
        self._skipped = False
        self._running: PlannedBlock | None = None
        self.ended = 0
        self.ticks = 0
        self.questions: list[CheckQuestion] = []

    @property
    def place(self) -> Place:
        """Where the protocol has the step that runs; the session before the first."""
        return _step(self._study, self._number, self.sequencer.step if self.sequencer else 0)

    def commands(self) -> list[Command]:
        if self._patience is None:
            return []
        self._patience -= 1.0 / self._rate_hz
        if self._patience > 0.0:
            return []
        self._patience, self._skipped = None, True
        return [Command(Order.SKIP)]

    def report(self, event: Event) -> None:
        if event.name == "trial.start":
            self._running = self._blocks.get(int(str(event.data["block"])))
            trials = self._running.trials if self._running else ()
            longest = max((trial.planned.expected_s for trial in trials), default=0.0)
            self._patience, self._skipped = PATIENCE_S + PATIENCE * longest, False
        elif event.name == "trial.end":
            self._patience = None
            self.ended += 1
            self._judge(str(event.data.get("outcome")))

    def timed(self, seconds: float) -> None:
        """Judge a rate by the time that a processor took for all ticks, whatever else it did."""
        period = 1.0 / self._rate_hz
        took = seconds / max(1, self.ticks)
        if self.ticks >= FEWEST_TICKS and took > HELD * period:
            self.questions.append(
                CheckQuestion(
                    "rehearsal.rate_hz",
                    ("rate_hz",),
                    f"rate_hz is {self._rate_hz:g} Hz, a tick every {1e3 * period:.3g} ms, and on "
                    f"this computer one takes {1e3 * took:.3g} ms to compute; is that meant?",
                )
            )

    def _judge(self, outcome: str) -> None:
        block = self._running
        if block is None or not (self._skipped or outcome == Phase.TIMEOUT):
            return
        took = "does not end it" if self._skipped else "runs out of time"
        self.questions.append(
            CheckQuestion(
                f"rehearsal.{block.name}",
                self.place,
                f"in a trial of block {block.name!r} the simulated operator {took}; is that meant?",
            )
        )


def _run(study: Study, plan: SessionPlan, examiner: _Examiner) -> None:
    """Run a plan as a session is run, and throw away what it records."""
    with tempfile.TemporaryDirectory(prefix="labcrane-rehearsal-") as place:
        visit = Visit(study, plan.participant, plan.number, Path(place), simulated=True, fast=True)
        rig = Rig.build(study, simulated=True)
        with (
            loosely_watched((*rig.components, *rig.tasks.values())),
            rig.opened(study, plan.seed) as run,
        ):
            opening = Event("session.start", 0.0, context(visit, plan, rig, run))
            drawing = _Drawing(study, run)
            visit.folder.make()
            held = columns(run)
            journal = SessionJournal(visit.journal, held, run.rate_hz, now=lambda: 0.0)
            log = BatchLog(journal, run)
            try:
                log.note(opening)
                examiner.sequencer = sequencer = Sequencer(study, plan, rig, waits=False)
                told = [drawing.draw, lambda frame: _tell(examiner, frame)]
                began = time.thread_time()
                loop.run(rig, run, sequencer, ManualClock(), examiner, log, told)
                examiner.timed(time.thread_time() - began - drawing.took_s)
            finally:
                log.close()
                drawing.close()


def _tell(examiner: _Examiner, frame: Frame) -> None:
    examiner.ticks += 1
    for event in frame.events:
        examiner.report(event)


class _Drawing:
    """The cues of a study, drawn without a view."""

    def __init__(self, study: Study, run: Run) -> None:
        self._left = DRAWN
        self.took_s = 0.0  # of a processor: views draw in processes of their own
        self._call_monitor = study.call_monitor
        self._cues: list[tuple[str, Cue, tuple[int, int]]] = []
        for name, choice in study.cues.items():
            cue = choice.build(study.machine)
            assert isinstance(cue, Cue)  # noqa: S101 - the registry filed its offer under its role
            self._call(name, choice, cue.open, run)
            watched = (self._number(name, choice, cue.draw), self._number(name, choice, cue.values))
            self._cues.append((f"cue {name!r}", cue, watched))

    def draw(self, frame: Frame) -> None:
        """Let every cue draw a frame of a trial, and say the numbers behind it."""
        if not frame.trial or not self._left:
            return
        self._left -= 1
        began = time.thread_time()
        for called, cue, (draw, values) in self._cues:
            self._call_monitor.call(draw, cue.draw, frame)
            self._call_monitor.call(values, promised, called, cue.signals, cue.values, frame)
        self.took_s += time.thread_time() - began

    def close(self) -> None:
        """Close them all."""
        for _, cue, _ in self._cues:
            cue.close()

    def _number(self, name: str, choice: ComponentSpec, method: Callable[..., object]) -> int:
        return self._call_monitor.place(f"cue {name!r}", choice.plugin, method.__name__, method)

    def _call(
        self, name: str, choice: ComponentSpec, method: Callable[[Run], object], run: Run
    ) -> None:
        self._call_monitor.call(self._number(name, choice, method), method, run)
