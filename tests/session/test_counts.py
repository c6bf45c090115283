"""Trials are counted in one way, on every screen and in every line."""

import io
import random
from dataclasses import replace
from pathlib import Path

import pytest
from rehearsal import SHORT, ScriptedConsole, a_study
from rich.console import Console

from labcrane import ProtocolError, open_recording
from labcrane.cli.terminal import Terminal
from labcrane.core import Event, SessionState
from labcrane.core.records import is_done
from labcrane.design.counts import TrialCounts, numbers, spans
from labcrane.design.plan import SessionPlan
from labcrane.recording.journal_reader import read_journal
from labcrane.session.eligibility import EXEMPT
from labcrane.session.session import outlook, still_owed
from labcrane.session.visit import check_begun, check_new
from labcrane.streams.context import situation_after
from labcrane.testing import Command, Order, QueueConsole, Visit, plan_session, run
from labcrane.web.state import SessionView
from labcrane.web.viewer.film import Film

PRACTISED = SHORT.replace(
    "      - block: {task: aiming, pairs: 1}",
    "      - practice: {task: aiming, pairs: 1}\n      - block: {task: aiming, pairs: 2}",
)
TWO = PRACTISED + PRACTISED.partition("sessions:\n")[2].replace("only", "again")


@pytest.fixture
def visit(tmp_path: Path) -> Visit:
    study = a_study(tmp_path, PRACTISED)
    return Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)


def planned(visit: Visit) -> SessionPlan:
    return plan_session(visit.study, visit.participant, visit.session)


def stopped(visit: Visit) -> None:
    """Run the visit and end it by order somewhere in its counted trials."""

    class Ending(ScriptedConsole):
        def commands(self) -> list[Command]:
            done = sum(is_done(event.data) for event in self.told if event.name == "trial.end")
            return [Command(Order.END)] if done == 1 else []

    run(visit, Ending())


def shown(counts: TrialCounts, events: list[Event]) -> list[str]:
    console, printed = QueueConsole(), io.StringIO()
    with Terminal(console, Console(file=printed, width=120), counts, keys=False):
        for event in events:
            console.report(event)
    return [line.strip() for line in printed.getvalue().splitlines()]


@pytest.mark.slow
def test_the_lines_the_bar_the_page_and_the_view_count_alike(visit: Visit) -> None:
    console = ScriptedConsole()
    run(visit, console)
    counts = TrialCounts.of(planned(visit))
    lines = shown(counts, console.told)
    ends = [line.partition(":")[0] for line in lines if "trial " in line and ": success" in line]
    practice = [f"practice trial {number}" for number in range(1, len(counts.practice) + 1)]
    assert ends == practice + [f"trial {n} of {counts.total}" for n in range(1, counts.total + 1)]
    assert f"{counts.total}/{counts.total}" in lines[-1]
    page, situation, seen = SessionView(), SessionState(), []
    for event in console.told:
        page.take(event)
        situation = situation_after(situation, event, counts.counted)
        seen += [situation.counted] * bool(situation.counted and event.name == "trial.start")
    assert page.trials_done == situation.done == counts.total
    assert seen == list(range(1, counts.total + 1))


@pytest.mark.slow
def test_a_resumed_session_goes_on_counting_where_it_stopped(visit: Visit) -> None:
    stopped(visit)
    counts = TrialCounts.of(planned(visit))
    ahead = outlook(replace(visit, resumed=True), EXEMPT)
    assert ahead.done == 1
    rest = f"trials 2-{counts.total} of {counts.total}"
    assert f"'aiming', {rest}" in ahead.text
    assert rest in still_owed(visit, EXEMPT)
    console = ScriptedConsole()
    run(replace(visit, resumed=True), console)
    told = [Event("session.standing", 0.0, {"done": ahead.done}), *console.told]
    assert f"{counts.total}/{counts.total}" in shown(counts, told)[-1]
    page = SessionView()
    for event in told:
        page.take(event)
    assert page.trials_done == counts.total


def test_the_record_keeps_the_numbers_of_its_trial_table(visit: Visit) -> None:
    stopped(visit)
    log, _ = read_journal([visit.journal])
    owed = next(event.data["owed"] for event in log.events if event.name == "session.end")
    last = planned(visit).trials[-1].number
    assert owed.endswith(f"-{last}")


def test_the_viewer_says_both_numbers_of_a_trial_of_a_resumed_session(visit: Visit) -> None:
    stopped(visit)
    file = run(replace(visit, resumed=True), ScriptedConsole())
    counts = TrialCounts.of(planned(visit))
    record = open_recording(file).session(1)
    film = Film(record, "P001")
    begun = {one["text"].lower().partition(" began")[0] for one in film.events}
    wanted = {f"{counts.name(number)} ({number} in the tables)" for number in counts.counted}
    assert wanted <= begun
    assert any(text.startswith("practice trial 1 (") for text in begun)
    assert "an approach movement" in begun
    assert set(counts.counted) == set(record.trials["trial"][record.trials["practice"] == 0])


def test_spans_of_any_numbers_are_read_back() -> None:
    dice = random.Random(1)
    for _ in range(200):
        some = sorted(dice.sample(range(1, 40), dice.randint(0, 30)))
        assert numbers(spans(some)) == some


def test_a_session_that_stopped_is_named_with_its_resume_command(visit: Visit) -> None:
    stopped(visit)
    with pytest.raises(
        ProtocolError,
        match=r"unfinished session 1 .*: by order; to continue, run: labcrane resume \S+study.yaml "
        r"--participant P001 --session 1 --simulate$",
    ):
        check_new(visit)


def test_a_resume_of_a_simulated_session_without_its_option_names_the_command(
    visit: Visit,
) -> None:
    stopped(visit)
    with pytest.raises(ProtocolError) as refused:
        check_begun(replace(visit, simulated=False, resumed=True))
    assert str(refused.value) == (
        f"P001 has no session 1 to continue, but P001-SIMULATED has one: run {visit.resume_command}"
    )
    assert visit.resume_command.endswith(" --simulate")
    check_begun(replace(visit, resumed=True))
    with pytest.raises(ProtocolError, match=r"there is no journal .* start one with labcrane run"):
        check_begun(replace(visit, session=2, resumed=True))
    with pytest.raises(ProtocolError) as refused:
        check_begun(replace(visit, participant="P001-SIMULATED", resumed=True))
    assert str(refused.value) == (
        "'P001-SIMULATED' is the name of a folder with recordings; write --participant P001 "
        "--simulate"
    )


def test_data_elsewhere_and_a_pilot_are_in_the_resume_command(visit: Visit, tmp_path: Path) -> None:
    there = replace(visit, data=tmp_path / "a b", pilot=True, simulated=False)
    _, _, options = there.resume_command.partition(" --data ")
    assert options[1:-9] == str(tmp_path / "a b")
    assert options.endswith(" --pilot")


@pytest.mark.slow
def test_the_next_session_is_named_where_there_is_one(tmp_path: Path) -> None:
    study = a_study(tmp_path, TWO)
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    run(visit, ScriptedConsole())
    with pytest.raises(ProtocolError, match=r"use the next one: --session 2 \('again'\)$"):
        check_new(visit)
