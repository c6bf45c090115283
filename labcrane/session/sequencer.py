"""Sequencer of a session: which step, which trial, paused or not, tick by tick.

The steps are read like a script: every ``yield`` in a generator below is one tick, and gives back
the frame that came of it.
"""

from collections.abc import Generator, Iterable, Mapping, Sequence
from math import inf

from labcrane.core.clock import Tick
from labcrane.core.records import UNDONE, Event, Frame, Phase, Trial, Value
from labcrane.core.signals import Layout
from labcrane.design.plan import PlannedBlock, PlannedStep, SessionPlan, next_attempt
from labcrane.design.practice import WarmUp
from labcrane.participants.personal_data import personal
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.session.commands import (
    AboutFailed,
    AnswerGiven,
    Command,
    Completion,
    ConsentGiven,
    Control,
    Denial,
    Malformed,
    Message,
    Order,
    Remark,
    Request,
    SettingChange,
    Sighting,
    Submission,
    beyond_limits,
    given_by,
    given_from,
    read_request,
)
from labcrane.session.live_settings import FeedbackSettings
from labcrane.session.pause import DISK, INPUT, Suspenders
from labcrane.session.questionnaire import QuestionnaireRun
from labcrane.session.resume import COMPLETE, INCOMPLETE, Ledger, owed_text, within_limits
from labcrane.session.standing import EXAMINER, STOP, SessionStage, Standing, why_not
from labcrane.session.stop_rules import MET, Said, after_trial
from labcrane.session.trial import TrialRun

Ticks = Generator[None, Frame, None]
Attempts = Generator[None, Frame, Phase]


MOST_STALLS = 3
"""In so many attempts at a trial one after the other the session stalls; then a person decides."""


class Sequencer:
    """Leads a session through its plan.

    The loop calls :meth:`keep_time` and :meth:`handle` before the machine moves, and
    :meth:`evaluate` after.

    Parameters
    ----------
    waits
        Whether instructions and blocks wait for the order to start. A simulated operator needs
        no telling.
    awaits
        The views and sounds that must present before the first step begins.
    sets_back
        Whether a trial that is repeated begins where its first attempt began.
    ledger
        Keeps account of what remains when the session ends; of ``plan`` unless it was resumed.

    Attributes
    ----------
    over
        Whether the session has ended.
    """

    def __init__(
        self,
        study: Study,
        plan: SessionPlan,
        rig: Rig,
        *,
        waits: bool,
        awaits: Iterable[str] = (),
        ledger: Ledger | None = None,
        sets_back: bool = True,
    ) -> None:
        self._study = study
        self._plan = plan
        self._rig = rig
        state = Layout("the machine", rig.dynamics.signals)
        self._angles = [state.index(f"joint.angle.{name}") for name in study.machine.names]
        self._waits = waits
        self._sets_back = sets_back
        self._rate_hz = study.protocol.rate_hz
        self._settings = FeedbackSettings({**study.cues, **study.sounds})
        self._notes: list[tuple[str, dict[str, Value]]] = []  # stamped with the tick they fall in
        self._ledger = ledger or Ledger(study, plan)
        # What can still be judged may have ended before this process began.
        self._standing = Standing(SessionStage.BETWEEN, last=self._ledger.unjudged)
        self._held = Suspenders(study.protocol.on_fault, self._say, awaits, people=waits)
        self._attempt: TrialRun | None = None
        self._step = 0
        self._questionnaire: QuestionnaireRun | None = None
        self._wishes: set[Order] = set()  # to start, skip or repeat what runs now
        self._warm_up = WarmUp()
        goes_on = study.protocol.on_fault.session_died == "continue"
        self._redone = {Phase.REPEATED} if goes_on else {Phase.REPEATED, Phase.INTERRUPTED}
        self._missed_until = -inf  # ticks that were due earlier were missed in a stall
        self._behind = False
        self._stalled = False  # in the movement under way
        self.over = False
        self._frame: Frame | None = None
        self._script = self._session()
        next(self._script, None)  # a session with nothing left ends at its first tick

    @property
    def step(self) -> int:
        """Number of the plan's step that runs; 0 before the first."""
        return self._step

    @property
    def standing(self) -> Standing:
        """Where the session stands."""
        return self._standing

    @property
    def moving(self) -> bool:
        """Whether the operator's command reaches the machine in this tick."""
        return self._attempt is not None and not self._at_rest

    @property
    def _at_rest(self) -> bool:
        """Whether the machine is held at rest."""
        return self._behind or bool(self._held.by)

    @property
    def going(self) -> TrialRun | None:
        """The trial under way, if its next tick is like the one before; None if something waits."""
        attempt = self._attempt
        waits = self._notes or self._wishes or self._at_rest or self._held.ending
        return None if waits or attempt is None or not attempt.ticks else attempt

    def keep_time(self, tick: Tick, before: Tick) -> None:
        """Hold the machine in ticks that a stall has missed, and interrupt the movement.

        The operator saw nothing of them, and their axes are those of after the stall.
        """
        stall_s = tick.late_s - before.late_s
        if stall_s > self._study.protocol.presented.max_gap_s:
            self._note("loop.stalled", seconds=round(stall_s, 3))
            self._stalled |= self.moving and self._attempt is not None and self._attempt.begun
            self._missed_until = tick.woke
        self._behind = tick.due < self._missed_until

    def handle(
        self, commands: Sequence[Message], lost_input: str | None, disk_trouble: str | None
    ) -> None:
        """Take up orders, and what has become of the operator's controls and of the disk."""
        for command in commands:
            if not isinstance(command, Command):
                self._held.report(command)
            else:
                self._take(command, read_request(command))
        self._held.watch(INPUT, lost_input)
        self._held.watch(DISK, disk_trouble)

    def evaluate(self, frame: Frame) -> None:
        """Complete ``frame``: trial, phase, the task's values, and everything that happened."""
        frame.paused = self._at_rest
        frame.events = self._stamped(frame)
        self._frame = frame
        try:
            self._script.send(frame)
        except StopIteration:
            self.over = True
            frame.events += self._stamped(frame)

    # The script

    def _session(self) -> Ticks:
        while self._held.awaited and not self._held.ending:
            yield
        if self._waits:
            for who in sorted(self._plan.held):
                self._held.hold(who)
            yield from self._decided()
        for step in self._plan.steps:
            if self._held.ending:
                break
            self._step = step.number
            self._note("step.start", step=step.number, kind=step.kind)
            yield from self._run(step)
            done = not self._held.ending
            self._note("step.end", step=step.number, kind=step.kind, done=done)
        if STOP in self._held:
            self._note("participant.dropout", why="ended while a stop rule was met")
        owed = owed_text(self._ledger.owed())
        why = ", ".join(self._held.ending) or (INCOMPLETE if owed else COMPLETE)
        self._note("session.end", reason=why, owed=owed)

    def _run(self, step: PlannedStep) -> Ticks:
        if step.block and not self._warm_up.begin(step.block) and not step.block.owed:
            pass  # practice has been enough; the step is done, also for who goes on later
        elif step.block:
            yield from self._block(step.block)
        elif step.kind == "break":
            yield from self._break(step)
        elif step.kind == "fixation":
            yield from self._fixation(step)
        elif step.kind == "consent":
            self._note("consent.asked")  # what was confirmed is in the session's context
            yield from self._gate("consent")
        elif step.kind == "questionnaire":
            for name in step.questionnaires:
                yield from self._ask(name, step.answered.get(name, {}))
        else:
            self._note("instructions.shown", text=step.text)
            yield from self._gate("instructions")

    def _gate(self, what: str) -> Ticks:
        if not self._waits:
            return
        self._enter()
        self._note("waiting", what=what)
        while Order.START not in self._wishes and not self._held.ending:
            yield
        self._enter()

    def _break(self, step: PlannedStep) -> Ticks:
        left = round(step.seconds * self._rate_hz)
        self._enter()
        self._note("break.start", seconds=step.seconds)
        while left > 0 and Order.SKIP not in self._wishes and not self._held.ending:
            yield
            left -= 1
        self._note("break.end", left=left / self._rate_hz)
        self._enter()

    def _fixation(self, step: PlannedStep) -> Ticks:
        """Show each point for its time in one piece; after a pause, from its beginning."""
        yield from self._gate("fixation")
        self._enter()
        for number, (x, y) in enumerate(step.points, start=1):
            left = round(step.seconds * self._rate_hz)
            while left > 0 and not self._wished_on():
                if self._held.by:
                    yield
                    continue
                self._note("fixation.shown", point=number, x=x, y=y)
                left = round(step.seconds * self._rate_hz)
                while left > 0 and not (self._held.by or self._wished_on()):
                    yield
                    left -= 1
                self._note("fixation.over", point=number, done=left == 0)
        self._enter()

    def _wished_on(self) -> bool:
        """Whether a request to skip to the next step, or to end, has come."""
        return Order.SKIP in self._wishes or bool(self._held.ending)

    def _block(self, block: PlannedBlock) -> Ticks:
        if block.trials or block.owed:  # else only its last test is still to be judged
            yield from self._gate(block.name)
        if self._held.ending:
            return
        about: dict[str, Value] = {"block": block.number, "block_name": block.name}
        self._note("block.start", **about, task=block.task, practice=block.practice)
        for owed in block.owed:
            yield from self._ask(owed.questionnaire, owed.answered, owed.after)
        for trial in block.trials:
            yield from self._judged(asked=bool(block.ask))
            if self._held.ending or (block.until and self._warm_up.over):
                break  # also at once: it may have been begun for what was still to be asked
            chosen = self._ledger.chosen(block, trial)
            if chosen is None:
                break  # its track has come to its end
            ended = yield from self._trial(block, chosen)
            for name in block.ask if trial.planned.counted and ended not in UNDONE else ():
                yield from self._ask(name, {}, trial)
        yield from self._judged()
        if block.track is not None:
            where = self._ledger.stands(block.track)
            self._note("track.end", **about, track=block.track.name, **where.row)
        self._note("block.end", **about)
        if not self._held.ending and (verdict := self._warm_up.verdict(block)) is not None:
            self._note("practice.end", **about, **verdict)

    def _judged(self, *, asked: bool = False) -> Ticks:
        """Give the experimenter time to judge the test that has ended, unless it was judged.

        A judgement does not end the wait: a slip can be mended, and an end be overridden too.
        There was time already where something was ``asked`` after the test. A fixed number of
        seconds would be too long for one experimenter and too short for another.
        """
        about = self._ledger.unjudged
        if asked or not (self._waits and about) or self._held.ending:
            return
        self._enter()
        self._note("judgement.awaited", **about)
        while Order.START not in self._wishes and not self._held.ending:
            yield
        self._note("judgement.over", **about, done=not self._held.ending)
        self._enter()

    def _trial(self, block: PlannedBlock, trial: Trial) -> Attempts:
        stalls = 0
        start = self._pose() if self._sets_back else ()
        while (ended := (yield from self._attempt_at(block, trial))) in self._redone:
            trial = next_attempt(self._study, self._plan, trial, trial.attempt + 1, start)
            stalls = stalls + 1 if ended is Phase.INTERRUPTED else 0
            if stalls >= MOST_STALLS and self._waits:
                self._held.hold(EXAMINER)
            elif stalls >= MOST_STALLS:
                self._held.ending.append("it stalled again and again in one trial")
        return ended

    def _attempt_at(self, block: PlannedBlock, trial: Trial) -> Attempts:
        """Run one attempt, when no missed tick is left; return how it ended."""
        while self._behind:
            yield
        task = self._study.tasks[block.task]
        attempt = TrialRun(task, block, trial, self._rate_hz)
        self._keep_what_was()
        for component in (*self._rig.components, task):
            component.begin_trial(trial)
        pose = trial.planned.start_pose or trial.start_pose
        if pose is not None:
            self._rig.dynamics.reset(pose)
        self._note("trial.start", **attempt.about)
        self._enter(attempt)
        while not attempt.phase.over:
            frame = yield
            attempt.evaluate(frame, self._wished_end())
        self._enter()
        self._know("trial.end", attempt.row)
        if trial.planned.counted:
            self._warm_up.count(block, attempt.phase)
            if attempt.phase not in UNDONE:
                yield from self._stopped(after_trial(self._study.protocol.stop_rules, attempt.row))
        return attempt.phase

    def _pose(self) -> tuple[float, ...]:
        """Return the present joint angles in rad."""
        return within_limits(self._study, self._rig.dynamics.state()[self._angles])

    def _keep_what_was(self) -> None:
        """Part the frame of this tick, not yet written, from arrays that a new trial resets."""
        frame = self._frame
        if frame is not None:
            frame.axes, frame.command = frame.axes.copy(), frame.command.copy()
            frame.state, frame.task = frame.state.copy(), frame.task.copy()

    def _ask(self, name: str, answered: Mapping[str, Value], after: Trial | None = None) -> Ticks:
        if self._held.ending:
            return
        questionnaire = self._questionnaire = QuestionnaireRun(
            self._study, self._plan, name, self._step, answered, after
        )
        self._enter()
        for said in questionnaire.begin(simulated=not self._waits):
            self._say(*said)
        yield
        while not (questionnaire.over or Order.SKIP in self._wishes or self._held.ending):
            yield
        self._questionnaire = None
        ended = questionnaire.end(skipped=Order.SKIP in self._wishes)
        self._enter()
        yield from self._stopped(ended)

    def _stopped(self, ended: Iterable[Said]) -> Ticks:
        """Note what is said at an end, and wait where a stop rule is met."""
        met = False
        for name, data in ended:
            self._say(name, data)
            met |= name == MET
        if self._waits and met:
            self._held.hold(STOP)
        yield from self._decided()

    def _decided(self) -> Ticks:
        """Wait until a stop rule that was met has been decided on."""
        while STOP in self._held and not self._held.ending:
            yield

    def _wished_end(self) -> Phase | None:
        if self._held.ending:
            return Phase.ENDED
        if Order.SKIP in self._wishes:
            return Phase.SKIPPED
        if Order.REPEAT in self._wishes:
            return Phase.REPEATED
        return Phase.INTERRUPTED if self._stalled else None

    def _enter(self, attempt: TrialRun | None = None) -> None:
        self._attempt = attempt
        self._stalled = False
        self._wishes.clear()

    # Orders

    def _take(self, command: Command, request: Request) -> None:
        questionnaire = self._questionnaire
        about: dict[str, Value] = {"by": given_by(command), **given_from(command)}
        match request:
            case Denial(why):
                self._note("page.denied", why=why, **about)
            case AnswerGiven() | Submission() if (
                questionnaire is not None and not questionnaire.over
            ):
                self._say(*questionnaire.handle(request, about))  # not submitted twice in one tick
            case _:
                # Every door has looked already; the loop must not fall when one has not.
                beyond = beyond_limits(command)
                refused = beyond or self._refusal(request)
                about |= self._afterwards(request)
                # What names a person must not be in the record, not even as a refused note.
                text = "" if beyond or personal(command.text) else command.text
                self._note(f"order.{command.order}", text=text, refused=refused, **about)
                if refused is None:
                    self._obey(request)

    def _afterwards(self, request: Request) -> dict[str, Value]:
        """Return which trial an order is about that came after its end, before the next began."""
        match request:
            case Control(Order.OVERRIDE) | Completion() if not self._attempt:
                whose = self._standing.last
                if not whose:
                    return {}
                return {"trial": whose["trial"], "attempt": whose["attempt"], "after": True}
        return {}

    def _obey(self, request: Request) -> None:
        match request:
            case Control(Order.PAUSE):
                self._held.hold(EXAMINER)
            case Control(Order.START) if self._standing.paused:
                self._held.release(EXAMINER)
                self._held.release(STOP)
            case Control(Order.END):
                self._held.ending.append("by order")
            case Control(Order.OVERRIDE):
                if self._attempt is not None:  # of one that has ended the event is all there is
                    self._attempt.lift_limits()
            case Control(order):
                self._wishes.add(order)
            case Completion(completed) if self._attempt is not None:
                self._attempt.completion = completed
            case AboutFailed(order, what):
                self._held.decide(what, without=order is Order.WITHOUT)
            case SettingChange():
                self._note("feedback.setting", **self._settings.change(request))
            case _:
                pass  # of a note, hint or report the event is all there is

    def _refusal(self, request: Request) -> str | None:
        """Return why a request makes no sense now, or None when it does."""
        match request:
            case Control(order) if why := why_not(order, self._standing):
                return why
            case Completion() | Malformed(Order.COMPLETION) if why := why_not(
                Order.COMPLETION, self._standing
            ):
                return why
            case Sighting(what):
                doubt = self._attempt.doubt(what) if self._attempt else None
                return why_not(Order.REPORT, self._standing) or doubt
            case AboutFailed(order, what):
                return self._standing.why_not_about(order, what)
            case AnswerGiven() | Submission():
                return "no questionnaire is asked"
            case ConsentGiven():
                return "consent is given before the session begins"
            case Remark(order, text) if found := personal(text):
                return f"a {order} must not contain {found}; remove it"
            case SettingChange():
                return self._settings.refusal(request)
            case Malformed(why=why):
                return why
        return None

    # What is written down

    def _note(self, name: str, **data: Value) -> None:
        self._say(name, data)

    def _say(self, name: str, data: dict[str, Value]) -> None:
        self._notes.append((name, data))
        self._know(name, data)

    def _know(self, name: str, data: Mapping[str, Value]) -> None:
        """Follow an event, in what remains and in where the session is."""
        self._ledger.take(name, data)
        self._standing = self._standing.after(name, data)

    def _stamped(self, frame: Frame) -> tuple[Event, ...]:
        if not self._notes:
            return ()
        events = tuple(Event(name, frame.tick.due, data) for name, data in self._notes)
        self._notes.clear()
        return events
