"""Stops and resumptions of every kind against a model: what is owed is done, and done once."""

import json
import math
import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)
from stoppable import block, idle_rig, stoppable, with_steps

from labcrane import DeviceError, ProtocolError
from labcrane.protocol.rig import Rig
from labcrane.protocol.steps import Step
from labcrane.recording.journal_reader import LoggedEvent, SessionLog, read_journal
from labcrane.recording.participant_file.session_group import _trial_rows
from labcrane.recording.paths import parts
from labcrane.session import session as session_module
from labcrane.session.commands import LauncherGone
from labcrane.session.resume import numbers, progress, remaining
from labcrane.session.session import record
from labcrane.testing import Command, Order, Study, Visit, plan_session

RESULTS = {"success", "failure", "timeout", "skipped"}
OPEN = ("ended", "interrupted")


class GoneError(Exception):
    """Stands for a process that is gone."""


class Room:
    """People who start what waits and answer what is asked, until the session stops.

    Parameters
    ----------
    stop, after
        How it stops, and after how many ticks; None lets it run.
    dice
        Draws orders in between, and the answers.
    """

    def __init__(self, stop: str | None, after: int, dice: random.Random) -> None:
        self._stop, self._after = stop, after
        self._dice = dice
        self._tick = 0
        self._due: list[tuple[int, Command]] = []
        self.busy = stop is not None

    def report(self, event) -> None:
        for order in self._after_event(event):  # some ticks later: people take their time
            self._due.append((self._tick + self._dice.randint(1, 4), order))

    def commands(self):
        self._tick += 1
        if self._stop and self._tick >= self._after:
            if self._stop in {"kill", "power cut"}:
                raise GoneError
            if self._stop == "fault":
                raise DeviceError("it broke")
            return [LauncherGone() if self._stop == "launcher" else Command(Order.END)]
        given = [order for due, order in self._due if due <= self._tick]
        self._due = [(due, order) for due, order in self._due if due > self._tick]
        if self.busy and self._dice.random() < 0.05:
            given.append(Command(self._dice.choice([Order.SKIP, Order.REPEAT, Order.NOTE]), "x"))
        return given

    def _after_event(self, event) -> Iterator[Command]:
        if event.name in {"waiting", "pause.start"}:
            yield Command(Order.START)
        if event.name == "questionnaire.start":
            kept = json.loads(event.data["kept"])
            for item in ("one", "two"):
                if item not in kept:
                    given = {"questionnaire": event.data["questionnaire"], "item": item}
                    answer = json.dumps({**given, "value": self._dice.randint(5, 10)})
                    yield Command(Order.ANSWER, answer)
            yield Command(Order.SUBMIT)
        if event.name == "questionnaire.refused":  # handed in before all was answered
            yield Command(Order.SUBMIT)


SOME = [("rating",), ("other",), ("rating", "other")]
ASKED = st.sampled_from([(), *SOME])
STEPS = st.one_of(
    st.builds(block, st.sampled_from(["block", "reference"]), st.integers(2, 4), ASKED, st.none()),
    st.builds(
        block,
        st.just("practice"),
        st.integers(2, 4),
        ASKED,
        st.tuples(st.integers(1, 3), st.integers(1, 3)),
    ),
    st.builds(Step, kind=st.just("break"), seconds=st.sampled_from([0.0, 0.3, 0.5])),
    st.just(Step(kind="instructions", text="Read this")),
    st.just(Step(kind="consent")),
    st.builds(
        Step,
        kind=st.just("questionnaire"),
        questionnaires=st.sampled_from(SOME),
    ),
)
STOPS = ("kill", "power cut", "fault", "launcher", "order")
POLICIES = st.sampled_from([None, "redo_trial", "redo_block", "continue"])


class Stops(RuleBasedStateMachine):
    """One session that is stopped and resumed, and what its journal must say of it."""

    folder: Path
    study: Study
    context = staticmethod(lambda *_: {})

    @initialize(steps=st.lists(STEPS, min_size=2, max_size=5), people=st.integers(0, 2).map(bool))
    def plan(self, *, steps: list[Step], people: bool) -> None:
        self._scratch = TemporaryDirectory(dir=self.folder)
        study = with_steps(self.study, steps)
        self.visit = Visit(
            study, "P001", 1, Path(self._scratch.name), fast=True, pilot=True, simulated=not people
        )
        self.whole = plan_session(study, "P001", 1)
        self.policies: set[str] = set()
        self.over = False

    def live(self, stop: str | None, after: int, seed: int, policy: str | None) -> None:
        """Run one process: the session's first, or one that goes on."""
        resumed = bool(parts(self.visit.journal))
        before = self.owed if resumed else None
        held = resumed and self.stop_rule_is_open()
        visit = replace(self.visit, resumed=resumed, policy=policy)
        begun = len(parts(self.visit.journal))
        refused = ""
        try:
            record(visit, Room(stop, after, random.Random(seed)))
        except ProtocolError as error:
            refused = str(error)
        except (GoneError, DeviceError):
            pass
        if refused:
            assert resumed
            assert policy == "continue"
            assert "under policy 'continue'; abandoned: " in refused
            return
        assert len(parts(self.visit.journal)) == begun + 1
        if resumed:
            self.policies.add(policy or "redo_trial")
        if stop == "power cut":
            self.tear(seed)
        self.look()
        self.check(resumed=resumed, before=before, held=held, policy=policy or "redo_trial")

    def tear(self, seed: int) -> None:
        """Let the last part lose what was not on the disk yet, down to its header."""
        journal = parts(self.visit.journal)[-1]
        whole = journal.read_bytes()
        first = whole.find(b"session.start")
        journal.write_bytes(whole[: random.Random(seed).randint(max(first, 0), len(whole))])

    def look(self) -> None:
        """Read the journal, as a resumption does."""
        self.events: list[LoggedEvent] = read_journal(parts(self.visit.journal))[0].events
        so_far = progress(self.visit.journal, self.visit.study.machine.names)
        self.owed = remaining(self.visit.study, self.whole, so_far, "redo_trial")

    def stop_rule_is_open(self) -> bool:
        if self.visit.simulated:
            return False
        last = [
            event.name
            for event in self.events
            if event.name == "stop_rule.met"
            or (event.name == "pause.end" and event.data["by"] == "stop rule")
        ]
        return bool(last) and last[-1] == "stop_rule.met"

    def check(self, *, resumed: bool, before, held: bool, policy: str) -> None:
        events = self.events
        part = len(parts(self.visit.journal))  # a power cut may leave none of its events
        mine = [event for event in events if event.part == part]
        names = [event.name for event in mine]
        if held and "step.start" in names:
            pauses = [at for at, event in enumerate(mine) if event.name == "pause.start"]
            assert mine[pauses[0]].data["by"] == "stop rule"
            assert pauses[0] < names.index("step.start"), "it goes on when somebody says so"
        if resumed and policy == "redo_trial":
            owed = {trial.number for each in before.blocks for trial in each.trials}
            begun = {event.data["trial"] for event in mine if event.name == "trial.start"}
            assert begun <= owed, "nothing is repeated that was done"
        ends = [event for event in mine if event.name == "session.end"]
        reasons = [event.data["reason"] for event in ends]
        if reasons == ["complete"]:
            self.over = True
            self.every_counted_trial_is_recorded_once()
            self.every_question_is_asked_to_its_end_once()
            self.every_other_step_is_done()
        for event in ends:
            left = {trial.number for each in self.owed.blocks for trial in each.trials}
            assert bool(event.data["owed"]) == bool(self.owed.steps)
            assert numbers_in(event.data["owed"]) == left

    def every_counted_trial_is_recorded_once(self) -> None:
        events = self.events
        ends = [event.data for event in events if event.name == "trial.end"]
        attempts = [(data["trial"], data["attempt"]) for data in ends]
        assert len(set(attempts)) == len(attempts), "no attempt has two ends"
        log = SessionLog(events=events)
        rows = [row for row in _trial_rows(log) if row["outcome"] in RESULTS]
        results = {row["trial"]: row["outcome"] for row in rows}
        assert len(rows) == len(results), "no trial has two results"
        valid = self.valid()
        results = {number: outcome for number, outcome in results.items() if number in valid}
        assert sorted(results) == sorted(self.due(results))

    def valid(self) -> dict[int, int]:
        """Return which trials have a result, in order, and which event said it.

        What was to be redone with its block is none until it is: practice may be enough before.
        """
        found: dict[int, int] = {}
        for at, event in enumerate(self.events):
            if event.name == "session.resumed":
                for number in numbers(event.data["void"]):
                    found.pop(number, None)
            elif event.name == "trial.end" and event.data["outcome"] in RESULTS:
                found[event.data["trial"]] = at
        return found

    def due(self, results: Mapping[int, str]) -> Iterator[int]:
        """Yield the counted trials that have to have a result: of practice, until it is enough.

        Trials count in the order in which they were done; one that was passed over ('continue')
        may come after those that follow it.
        """
        done_at = self.valid()
        group: list[int] = []
        for step in self.whole.steps:
            mine = step.block
            if mine is None:
                continue
            group += [trial.number for trial in mine.trials if trial.planned.counted]
            if mine.until is not None and not mine.last:
                continue
            streak, enough = 0, math.inf
            for number in sorted(set(group) & set(results), key=done_at.__getitem__):
                streak = streak + 1 if results[number] == "success" else 0
                if mine.until is not None and streak >= mine.until.successes:
                    enough = min(enough, done_at[number])
            over = enough < math.inf
            yield from (n for n in group if not over or (n in results and done_at[n] <= enough))
            group = []

    def every_question_is_asked_to_its_end_once(self) -> None:
        ended = [event.data for event in self.events if event.name == "questionnaire.end"]
        done = [
            (data["step"], data.get("trial"), data["questionnaire"])
            for data in ended
            if data["done"]
        ]
        results = {
            row["trial"]: row["outcome"]
            for row in _trial_rows(SessionLog(events=self.events))
            if row["outcome"] in RESULTS and row["trial"] in self.valid()
        }
        due = [
            (step.number, None, name) for step in self.whole.steps for name in step.questionnaires
        ]
        counted = set(self.due(results))
        due += [
            (step.number, trial.number, name)
            for step in self.whole.steps
            if step.block
            for trial in step.block.trials
            if trial.number in counted
            for name in step.block.ask
        ]
        if "redo_block" in self.policies:  # of what was redone, or was void and not needed again
            assert set(done) >= set(due)
        else:
            assert sorted(done, key=str) == sorted(due, key=str)

    def every_other_step_is_done(self) -> None:
        done = {
            event.data["step"]
            for event in self.events
            if event.name == "step.end" and event.data["done"]
        }
        plain = [step for step in self.whole.steps if not (step.block or step.questionnaires)]
        assert done >= {step.number for step in plain}

    @precondition(lambda self: not self.over)
    @rule(
        stop=st.sampled_from(STOPS),
        after=st.integers(1, 40),
        seed=st.integers(0, 2**32),
        policy=POLICIES,
    )
    def stopped(self, stop: str, after: int, seed: int, policy: str | None) -> None:
        self.live(stop, after, seed, policy)

    @precondition(lambda self: self.over)
    @rule(policy=st.sampled_from([None, "redo_trial"]))
    def resumed_for_nothing(self, policy: str | None) -> None:
        with pytest.raises(ProtocolError, match="is complete, so there is nothing"):
            record(replace(self.visit, resumed=True, policy=policy), Room(None, 0, None))

    def teardown(self) -> None:
        if not hasattr(self, "visit"):
            return
        if not self.over:
            self.live(None, 0, 1, "redo_trial")
            assert self.over, "undisturbed it comes to its end"
        self._scratch.cleanup()


def numbers_in(owed: str) -> set[int]:
    found: set[int] = set()
    for part in owed.split("; "):
        # "trials 5-8", or of one alone "trial 5".
        spans = re.search(r", trials? (.+)", part)
        for span in spans[1].split() if spans else ():
            first, _, last = span.partition("-")
            found |= set(range(int(first), int(last or first) + 1))
    return found


@pytest.fixture
def stops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> type[Stops]:
    study = stoppable(tmp_path)
    # What a session knows of the computer and its packages takes longer than all its ticks.
    monkeypatch.setattr(session_module, "context", lambda *_: {})
    monkeypatch.setattr(Rig, "build", lambda study, **_: idle_rig(study))
    return type("StopsHere", (Stops,), {"folder": tmp_path, "study": study})


def play(stops: type[Stops], sequences: int) -> None:
    run_state_machine_as_test(
        stops,
        settings=settings(
            max_examples=sequences,
            stateful_step_count=8,
            deadline=None,
            derandomize=True,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.mark.slow
def test_whatever_stops_a_session_it_owes_what_is_left_and_no_more(stops: type[Stops]) -> None:
    play(stops, 60)


def test_a_practice_that_was_enough_does_not_stand_for_the_next_one(stops: type[Stops]) -> None:
    """Its last rounds are not needed; the session that goes on has none of them to end it."""
    one = stops()
    once, thrice = (1, 1), (1, 3)
    one.plan(
        steps=[block("practice", 2, (), once), block("practice", 2, ("rating",), thrice),
               block("practice", 2, (), once)],
        people=True,
    )  # fmt: skip
    for after in (16, 7, 6):
        one.stopped(after=after, policy=None, seed=1, stop="kill")
    assert [step.number for step in one.owed.steps] == [3, 5], "a rating, and the next one"
    one.teardown()


@pytest.mark.parametrize(
    "sequences",
    [
        pytest.param(250, marks=pytest.mark.long),
        pytest.param(2000, marks=[pytest.mark.soak, pytest.mark.timeout(1800)]),
    ],
)
def test_drawn_sequences_of_stops_owe_what_is_left(stops: type[Stops], sequences: int) -> None:
    play(stops, sequences)
