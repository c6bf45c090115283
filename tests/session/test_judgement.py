"""The supervisor judges a test after its end: the session waits for that, and only where one is."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from rehearsal import DiesError, ScriptedConsole
from simple_crane import CRANE

from labcrane import ProtocolError, Tick, open_recording
from labcrane.analysis import find_cohort
from labcrane.analysis.scoring.operator_tests import OperatorTest, operator_tests
from labcrane.cli.terminal import event_line
from labcrane.core import Event, SessionState
from labcrane.replay import replay_session
from labcrane.session.resume import progress, remaining
from labcrane.streams.context import situation_after
from labcrane.testing import Command, Order, Visit, discover, load, plan_session, run
from labcrane.web.control_room.buttons import buttons
from labcrane.web.control_room.condition import state_of
from labcrane.web.state import SessionView
from labcrane_view.hud import notice, standing

SCORED = '''\
import numpy as np

from labcrane import InputDevice, Settings, Signal, Task, hookimpl, offer
from labcrane.core import Phase, PlannedTrial, TrialStatus

labcrane_api = 1
HARD = 3
NAMES = ("time", "n_object", "n_body", "n_overload_max", "n_overload_min")


class Scored(Task):
    """Tests of 24 ticks; all succeed but one, which ends with five bodies hit."""

    signals = (Signal("left", "1"),)
    results = tuple(Signal(name, "1") for name in NAMES)

    def factors(self):
        return {"scenario": ("touch", "carry")}

    def plan(self, levels):
        return [PlannedTrial({"scenario": each}, expected_s=0.1) for each in levels["scenario"]]

    def begin_trial(self, trial):
        self._left, self._hard = 24, trial.number == HARD

    def evaluate(self, frame):
        self._left -= 1
        values = np.array([float(self._left)])
        if self._left > 0:
            return TrialStatus(Phase.RUNNING, values)
        bodies = 5 if self._hard else 0
        results = dict(zip(NAMES, (0.1, 0, bodies, 0, 0), strict=True))
        return TrialStatus(Phase.FAILURE if self._hard else Phase.SUCCESS, values, (), results)

    def lift_limits(self):
        pass


class Still(InputDevice):
    """Two joysticks that nobody touches."""

    signals = (Signal("left", "1", ("x", "y")), Signal("right", "1", ("x", "y")))

    def read(self, tick, seen):
        return np.zeros(4)


@hookimpl
def labcrane_inputs():
    return [offer("still", Settings, lambda settings, machine: Still())]


@hookimpl
def labcrane_tasks():
    return [offer("scored", Settings, lambda settings, machine: Scored())]
'''
STUDY = (
    "labcrane: 1\nstudy: judged\ntitle: Tests that are judged\nrate_hz: 240\n"
    + CRANE.replace("dual_joystick}", "still}\noperator: {use: still}")
    + """\
tasks:
  scored: {use: scored}
design: {order: {scenario: as_written}}
sessions:
  - name: only
    steps:
      - reference: {task: scored}
      - block: {task: scored%s}
"""
)
ASKED = ", ask: [subjective_accuracy, situational_awareness]"


LAST = 4
"""The second of two tests; before them there are two trials of reference."""


def a_visit(
    folder: Path, text: str = STUDY % "", *, simulated: bool = False, hard: int = 3
) -> Visit:
    (folder / "plugins").mkdir(exist_ok=True)
    (folder / "plugins" / "scored.py").write_text(
        SCORED.replace("HARD = 3", f"HARD = {hard}"), encoding="utf-8"
    )
    protocol = folder / "study.yaml"
    protocol.write_text(text, encoding="utf-8")
    study = load(protocol, discover(study=protocol))
    return Visit(study, "P001", 1, folder / "data", simulated=simulated, fast=True, pilot=True)


Judge = Callable[[Event], Sequence[Command]]


class Supervisor(ScriptedConsole):
    """Starts blocks, answers what is asked, and judges a test when the session waits for it.

    Parameters
    ----------
    judge
        What is ordered when the session waits for a judgement, one order every other tick.
    """

    def __init__(self, judge: Judge = lambda event: [], *, patience: int = 2000) -> None:
        super().__init__()
        self._judge = judge
        self._due: list[Command] = []
        self._patience = patience
        self.heard: list[Event] = []

    def commands(self) -> list[Command]:
        news, self.told = self.told, []
        self.heard += news
        for event in news:
            self._due += self._after(event)
        self._patience -= 1
        assert self._patience, "the session does not end"
        return [self._due.pop(0)] if self._due and self._patience % 2 else []

    def _after(self, event: Event) -> Sequence[Command]:
        match event.name:
            case "waiting":
                return [Command(Order.START)]
            case "questionnaire.start":
                about = {"questionnaire": event.data["questionnaire"], "item": "rating"}
                given = Command(Order.ANSWER, json.dumps({**about, "value": 5}))
                return [given, Command(Order.SUBMIT)]
            case "judgement.awaited":
                return self._judge(event)
        return []


GO = Command(Order.START)
COMPLETED, MISSED = Command(Order.COMPLETION, "1"), Command(Order.COMPLETION, "0")
OVERRIDE = Command(Order.OVERRIDE)


def dies(event: Event) -> Sequence[Command]:
    raise DiesError


def scores(visit: Visit) -> list[OperatorTest]:
    return operator_tests(find_cohort(visit.data, ["pilot", "half-finished"]))


def data_of(session, name: str) -> list[dict]:
    events = session.events
    return list(events.loc[events["name"] == name, "data"])


def test_the_last_test_is_judged_after_its_end_and_record_and_indicator_hold_it(
    tmp_path: Path,
) -> None:
    visit = a_visit(tmp_path, STUDY % ASKED)
    path = run(visit, Supervisor(lambda event: [MISSED, GO]))
    session = open_recording(path).session(1)
    [awaited], [over] = data_of(session, "judgement.awaited"), data_of(session, "judgement.over")
    last = session.trials.iloc[-1]
    assert (awaited["trial"], awaited["attempt"]) == (last["trial"], 1)
    assert over["done"] is True
    names = session.events["name"].tolist()
    at = [names.index(each) for each in ("judgement.awaited", "order.completion", "session.end")]
    assert at == sorted(at)
    assert last["outcome"] == "success"
    assert last["completion"] == 0
    first, second = scores(visit)
    assert first.why == "more than 4 mistakes of one kind"
    assert (second.indicator.completed, second.why) == (False, "set by the experimenter")
    assert data_of(session, "session.end") == [{"reason": "complete", "owed": ""}]


def test_a_judgement_can_be_mended_and_an_end_overridden_until_the_supervisor_goes_on(
    tmp_path: Path,
) -> None:
    visit = a_visit(tmp_path, hard=LAST)
    judged = iter([[GO], [MISSED, OVERRIDE, COMPLETED, GO]])
    path = run(visit, Supervisor(lambda event: next(judged)))
    session = open_recording(path).session(1)
    given = [data["text"] for data in data_of(session, "order.completion")]
    assert given == ["0", "1"]
    number = session.trials.iloc[-1]["trial"]
    for name in ("order.completion", "order.override"):
        assert {(each["trial"], each["after"]) for each in data_of(session, name)} == {
            (number, True)
        }
    easy, hard = scores(visit)
    assert (easy.indicator.completed, easy.why) == (True, "the task was done")
    assert (hard.indicator.completed, hard.why) == (True, "set by the experimenter")


@pytest.mark.parametrize(("asked", "waits"), [("", [3, 4]), (ASKED, [4])])
def test_every_test_leaves_time_to_be_judged_before_the_next_begins(
    tmp_path: Path, asked: str, waits: list[int]
) -> None:
    visit = a_visit(tmp_path, STUDY % asked)
    seen = Supervisor(lambda event: [GO])
    run(visit, seen)
    assert [each.data["trial"] for each in seen.heard if each.name == "judgement.awaited"] == waits


def test_who_judged_a_test_while_its_ratings_were_asked_is_not_waited_for(tmp_path: Path) -> None:
    visit = a_visit(tmp_path, STUDY % ASKED)

    class Early(Supervisor):
        def _after(self, event: Event) -> Sequence[Command]:
            given = super()._after(event)
            return [COMPLETED, *given] if event.name == "questionnaire.start" else given

    session = open_recording(run(visit, Early())).session(1)
    assert data_of(session, "judgement.awaited") == []
    assert session.trials["completion"].tolist()[2:] == [1, 1]


@pytest.mark.parametrize("asked", ["", ASKED])
@pytest.mark.parametrize("stop", ["kill", "end"])
def test_a_session_that_stopped_in_the_wait_is_resumed_in_it_and_repeats_nothing(
    tmp_path: Path, asked: str, stop: str
) -> None:
    visit = a_visit(tmp_path, STUDY % asked)

    def stops(event: Event) -> Sequence[Command]:
        if event.data["trial"] != LAST:
            return [GO]
        return dies(event) if stop == "kill" else [Command(Order.END)]

    try:
        run(visit, Supervisor(stops))
    except DiesError:
        assert stop == "kill"
    before = open_recording(visit.folder.participant_file).session(1)
    assert len(before.trials) == 4, "what was recorded is there"
    whole = plan_session(visit.study, "P001", 1)
    so_far = progress(visit.journal, visit.study.machine.names)
    left = remaining(visit.study, whole, so_far, "redo_trial")
    assert [(step.number, step.block.unjudged, step.block.trials) for step in left.steps] == [
        (2, LAST, ())
    ]
    if stop == "end":
        [end] = data_of(before, "session.end")
        assert end["owed"].endswith("judgement of trial 4")
    seen = Supervisor(lambda event: [MISSED, OVERRIDE, GO])
    path = run(replace(visit, resumed=True), seen)
    names = [each.name for each in seen.heard]
    assert "trial.start" not in names
    assert "questionnaire.start" not in names
    assert "waiting" not in names, "nothing is begun that would have to be started"
    session = open_recording(path).session(1)
    assert len(session.trials) == 4
    assert session.trials.iloc[-1]["completion"] == 0
    assert [each.get("refused") for each in data_of(session, "order.override")] == [None]
    assert scores(visit)[-1].why == "set by the experimenter"
    assert data_of(session, "session.end")[-1]["reason"] == "complete"
    with pytest.raises(ProtocolError, match="is complete, so there is nothing"):
        run(replace(visit, resumed=True), Supervisor())


def test_a_session_killed_in_the_very_tick_of_its_last_tests_end_still_owes_the_judgement(
    tmp_path: Path,
) -> None:
    visit = a_visit(tmp_path, STUDY % "")

    class Dies(Supervisor):
        def _after(self, event: Event) -> Sequence[Command]:
            if event.name == "trial.end" and event.data["trial"] == LAST:
                raise DiesError
            return super()._after(event)

    with pytest.raises(DiesError):
        run(visit, Dies(lambda event: [GO]))
    path = run(replace(visit, resumed=True), Supervisor(lambda event: [COMPLETED, GO]))
    session = open_recording(path).session(1)
    assert [each["trial"] for each in data_of(session, "judgement.awaited")] == [3, 4]
    assert session.trials["completion"].tolist()[-1] == 1


def test_one_who_was_judged_before_the_process_died_is_not_waited_for_again(
    tmp_path: Path,
) -> None:
    visit = a_visit(tmp_path, STUDY % ASKED)

    class Dies(Supervisor):
        def _after(self, event: Event) -> Sequence[Command]:
            if event.name == "order.completion":
                raise DiesError
            return super()._after(event)

    with pytest.raises(DiesError):
        run(visit, Dies(lambda event: [MISSED]))
    path = run(replace(visit, resumed=True), Supervisor())
    session = open_recording(path).session(1)
    assert len(data_of(session, "judgement.awaited")) == 1
    assert session.trials.iloc[-1]["completion"] == 0


def test_without_a_time_of_reference_there_is_no_indicator_and_nothing_waits(
    tmp_path: Path,
) -> None:
    plain = (STUDY % "").replace("reference:", "block:")
    seen = Supervisor()
    run(a_visit(tmp_path, plain), seen)
    assert "judgement.awaited" not in {each.name for each in seen.heard}


def test_a_session_that_waited_is_replayed_bit_for_bit_and_one_of_before_as_well(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, waits in (("now", True), ("before", False)):
        folder = tmp_path / name
        folder.mkdir()
        if not waits:
            monkeypatch.setattr("labcrane.session.metadata._of_judgement", lambda visit: {})
        path = run(a_visit(folder), Supervisor(lambda event: [MISSED, GO]))
        session = open_recording(path).session(1)
        assert bool(data_of(session, "judgement.awaited")) is waits
        again = replay_session(path, 1, run_code=True)
        assert again.difference is None
        assert again.ticks == len(session.streams["state"].time)


def test_the_operator_sees_a_quiet_screen_while_the_supervisor_judges(tmp_path: Path) -> None:
    seen = Supervisor(lambda event: [GO])
    run(a_visit(tmp_path, STUDY % ASKED), seen)
    state, shown = SessionState(), None
    for event in (*seen.heard, *seen.told):
        state = situation_after(state, event)
        if event.name == "judgement.awaited":
            shown = state
    assert (shown.waiting, shown.trial, shown.active, shown.text) == ("judgement", 0, (), "")
    assert shown.questionnaire == ""
    frame = SimpleNamespace(paused=False, tick=Tick(0, 1e6, 1e6))
    assert standing(frame, shown) == "wait"
    assert notice(frame, shown, 5.0, "en") == []
    assert state.waiting == ""


def test_page_and_terminal_say_what_it_waits_for_and_can_judge_also_after_a_resume() -> None:
    said = event_line(Event("judgement.awaited", 1.0, {"trial": 3, "attempt": 1}), str)
    assert said == (
        "Waiting for the experimenter to judge the test "
        "(c completion, o override; space to continue)"
    )
    view = SessionView()
    view.take(Event("session.start", 0.0, {}))
    view.take(Event("step.start", 0.0, {"step": 2, "kind": "block"}))
    view.take(Event("judgement.awaited", 1.0, {"trial": 3, "attempt": 1}))
    assert state_of(view) == "judgement"
    assert "mark it completed or not, or override its end, then continue" in view.text
    found = {one.ident: one for one in buttons(view)}
    assert (found["order-start"].label, found["order-start"].primary) == ("Continue", True)
    for ident in ("order-start", "order-override", "order-completion0", "order-completion1"):
        assert found[ident].why == ""
    assert found["order-repeat"].why
    view.take(Event("judgement.over", 2.0, {"trial": 3, "attempt": 1, "done": True}))
    assert state_of(view) == "between"


class Cuts(Supervisor):
    """Gives one command within a test; None is a killed process."""

    def __init__(self, trial: int, command: Command | None) -> None:
        super().__init__(lambda event: [GO])
        self._trial, self._command, self._left = trial, command, 8

    def commands(self) -> list[Command]:
        given = super().commands()
        running = [event for event in self.heard if event.name == "trial.start"]
        if not running or running[-1].data["trial"] != self._trial or not self._left:
            return given
        self._left -= 1
        if self._left:
            return given
        if self._command is None:
            raise DiesError
        return [self._command]


@pytest.mark.parametrize("trial", [3, 4])
@pytest.mark.parametrize("order", [None, Order.END, Order.REPEAT, Order.SKIP])
def test_a_test_that_is_cut_off_costs_nobody_the_score_of_the_others(
    tmp_path: Path, trial: int, order: Order | None
) -> None:
    """Where it is done again, the last attempt is scored; what was skipped is named."""
    visit = a_visit(tmp_path, hard=99)
    try:
        run(visit, Cuts(trial, order and Command(order)))
    except DiesError:
        assert order is None
    if order in {None, Order.END}:
        run(replace(visit, resumed=True), Supervisor(lambda event: [GO]))
    left_out: list[tuple[str, str]] = []
    cohort = find_cohort(visit.data, ["pilot", "half-finished"])
    tests = operator_tests(cohort, leave_out=lambda *about: left_out.append(about))
    whole = {3, 4} - ({trial} if order is Order.SKIP else set())
    assert {test.trial for test in tests} == whole
    assert len(tests) == len(whole)
    said = f"skipped trial {trial} of session 1: nothing there to score"
    assert [why for _, why in left_out] == [said] * (order is Order.SKIP)
