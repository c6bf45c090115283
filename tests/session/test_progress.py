"""Going on after a crash: what is left of a session, by each policy."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rehearsal import SHORT, DiesError, DiesInTrial, ScriptedConsole, a_study

from labcrane import ProtocolError, open_recording
from labcrane.recording.paths import parts
from labcrane.session.resume import progress, remaining
from labcrane.session.session import finish, record
from labcrane.testing import Command, Order, Visit, plan_session, run

TWO_BLOCKS = SHORT.replace(
    "- block: {task: aiming, pairs: 1}",
    "- block: {task: aiming, pairs: 1}\n      - block: {task: aiming, pairs: 2, name: second}",
)


@pytest.fixture
def visit(tmp_path: Path) -> Visit:
    study = a_study(tmp_path, TWO_BLOCKS)
    return Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)


@pytest.fixture
def died(visit: Visit) -> Visit:
    """A session that died in trial 5, the second of its second block."""
    with pytest.raises(DiesError):
        record(visit, DiesInTrial(5, ticks=100))
    return visit


def test_progress_is_what_the_journal_says(died: Visit) -> None:
    so_far = progress(died.journal, died.study.machine.names)
    assert not so_far.called_complete
    assert so_far.steps == {1}
    assert set(so_far.done) == {1, 2, 3, 4}
    assert so_far.interrupted["trial"] == 5
    finish(died)
    state = open_recording(died.folder.participant_file).session(1).streams["state"].data
    assert so_far.angles == tuple(state.iloc[-1, :4])


@pytest.mark.parametrize(
    ("policy", "trials"),
    [
        ("continue", [(6, 1), (7, 1), (8, 1), (9, 1)]),
        ("redo_trial", [(5, 2), (6, 1), (7, 1), (8, 1), (9, 1)]),
        ("redo_block", [(4, 2), (5, 2), (6, 2), (7, 2), (8, 2), (9, 2)]),
    ],
)
def test_what_is_left_depends_on_the_policy(died: Visit, policy: str, trials: list) -> None:
    plan = plan_session(died.study, "P001", 1)
    so_far = progress(died.journal, died.study.machine.names)
    left = remaining(died.study, plan, so_far, policy)
    (step,) = left.steps
    assert step.number == 2
    assert [(trial.number, trial.attempt) for trial in step.block.trials] == trials
    first = {(t.number, t.attempt): t.seed for block in plan.blocks for t in block.trials}
    for trial in step.block.trials:
        assert (trial.seed == first.get((trial.number, trial.attempt))) == (trial.attempt == 1)


def test_a_resumed_session_goes_on_where_the_machine_stood_and_ends_whole(died: Visit) -> None:
    path = run(replace(died, resumed=True, policy="redo_trial"), ScriptedConsole())
    session = open_recording(path).session(1)
    assert sorted(p.name for p in died.folder.path.glob("*.xdf")) == [
        "ses-01_run.part2.xdf",
        "ses-01_run.xdf",
    ]
    rows = list(session.trials[["trial", "attempt", "outcome"]].itertuples(index=False, name=None))
    assert rows == [
        (2, 1, "success"),
        (3, 1, "success"),
        (5, 1, "interrupted"),
        (5, 2, "success"),
        (6, 1, "success"),
        (8, 1, "success"),
        (9, 1, "success"),
    ]
    assert session.events["name"].tolist().count("session.start") == 2
    state = session.streams["state"].data.to_numpy()
    part = session.streams["loop"].data["tick"].to_numpy()
    (border,) = np.flatnonzero(np.diff(part) < 0)
    # One tick of the crane lies between the last frame before and the first one after.
    assert np.abs(state[border + 1, :4] - state[border, :4]).max() < 0.01


@pytest.mark.slow
def test_a_session_that_is_complete_is_not_gone_on_with(visit: Visit) -> None:
    run(visit, ScriptedConsole())
    with pytest.raises(ProtocolError, match="session 1 of P001-SIMULATED is complete"):
        run(replace(visit, resumed=True), ScriptedConsole())


def test_a_session_that_was_never_begun_is_not_gone_on_with(visit: Visit) -> None:
    with pytest.raises(ProtocolError, match="and so no session to continue; start one with"):
        run(replace(visit, resumed=True), ScriptedConsole())


RATED = SHORT.replace("{use: dual_joystick}", "{use: simulated_operator}").replace(
    "{task: aiming, pairs: 1}", "{task: aiming, pairs: 1, ask: [tlx, subjective_accuracy]}"
)
TLX = "questionnaires: {tlx: {use: nasa_tlx}}\n"
SIX = ("mental", "physical", "temporal", "performance", "effort", "frustration")


class Rater(ScriptedConsole):
    """Starts what waits and answers what is asked, until so many answers were given; then dies."""

    def __init__(self, dies_after: int | None = None) -> None:
        super().__init__()
        self._left = dies_after

    def commands(self):
        news, self.told = self.told, []
        return [order for event in news for order in self._orders_after(event)]

    def _orders_after(self, event):
        if event.name == "waiting":
            return [Command(Order.START)]
        if event.name != "questionnaire.start":
            return []
        name = event.data["questionnaire"]
        items = SIX if name == "tlx" else ("rating",)
        left = [item for item in items if item not in json.loads(event.data["kept"])]
        if self._left is not None:
            left = left[: self._left]
            self._left -= len(left)
        values = [
            Command(Order.ANSWER, json.dumps({"questionnaire": name, "item": item, "value": 5}))
            for item in left
        ]
        if self._left == 0:
            self.report = self.die_after(len(values))
            return values
        return [*values, Command(Order.SUBMIT)]

    def die_after(self, answers: int):
        seen = []

        def report(event) -> None:
            seen.extend([event] if event.name == "questionnaire.answer" else [])
            if len(seen) == answers:
                raise DiesError

        return report


# Six answers and one follow each of the two trials.
@pytest.mark.parametrize("answers", [2, 7, 9, 14])
def test_the_rating_of_a_trial_that_was_cut_off_is_asked_on(tmp_path: Path, answers: int) -> None:
    study = a_study(tmp_path, RATED + TLX)
    visit = Visit(study, "P001", 1, tmp_path / "data", fast=True, pilot=True)
    with pytest.raises(DiesError):
        record(visit, Rater(answers))
    path = run(replace(visit, resumed=True), Rater())
    session = open_recording(path).session(1)
    table = session.questionnaires
    given = table[table["kind"] == "answer"]
    trials = session.trials["trial"].tolist()
    assert given.groupby(["trial", "questionnaire"]).size().to_dict() == {
        (trial, name): count
        for trial in trials
        for name, count in (("tlx", 6), ("subjective_accuracy", 1))
    }
    scores = table[table["kind"] == "score"]
    assert scores["value"].tolist() == [5.0, 0.5] * 2
    assert session.trials["outcome"].tolist() == ["success"] * 2


def test_a_session_begun_by_another_plan_is_not_gone_on_with(tmp_path: Path) -> None:
    begun = Visit(a_study(tmp_path, SHORT), "P001", 1, tmp_path / "data", simulated=True, fast=True)
    record(begun, ScriptedConsole({100: [Command(Order.END)]}))
    other = tmp_path / "other"
    other.mkdir()
    study = a_study(other, SHORT.replace("distances: [2]", "distances: [2.5]"))
    with pytest.raises(
        ProtocolError,
        match=r"begun with another plan: trial 1 was pair '2m_\w+', distance 2\.0, .* and the plan "
        r"has pair '2\.5m_\w+', distance 2\.5, .*; continue with the protocol, and the place in "
        r"the design, with which it was begun",
    ):
        record(replace(begun, study=study, resumed=True), ScriptedConsole())
    assert len(parts(begun.journal)) == 1, "nothing was begun"
