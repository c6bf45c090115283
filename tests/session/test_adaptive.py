"""Sessions whose levels are chosen while they run: killed, gone on with, carried on, replayed."""

import json
from pathlib import Path

import pytest
from needs import needs
from rehearsal import DiesError, DiesInTrial, ScriptedConsole, a_study
from simple_crane import CRANE

from labcrane import ProtocolError, open_recording
from labcrane.approval.codebook import codebook
from labcrane.design.tracks import standing
from labcrane.replay import replay_session
from labcrane.session.resume import progress, remaining
from labcrane.session.session import record
from labcrane.simulation.simulation import SimulationJob, simulate
from labcrane.testing import Command, Order, Visit, main, plan_session, run

ADAPTIVE = (
    """\
labcrane: 1
study: adaptive
title: Levels by what somebody does
rate_hz: 60
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [1, 2, 3, 4], movements: 2}
design:
  tracks:
    reach:
      factor: pairs
      levels: {1m_far_left: 1, 2m_far_left: 2, 3m_far_left: 3, 4m_far_left: 4}
      up_down: {harder_after: 2, reversals: 3, leave_out: 0}
      rounds: 8
      measure: movement_time
      at_most: LIMIT
sessions:
  - {name: one, steps: [{block: {task: aiming, track: reach}}]}
  - {name: two, steps: [{block: {task: aiming, track: reach}}]}
"""
)
STAIRS = ADAPTIVE.replace("LIMIT", "7.0")
QUEST = STAIRS.replace(
    "up_down: {harder_after: 2, reversals: 3, leave_out: 0}", "quest_plus: {spreads: [0.5, 1]}"
)


def visit(folder: Path, text: str, session: int = 1, **options) -> Visit:
    folder.mkdir(exist_ok=True)
    study = a_study(folder, text)
    return Visit(study, "P001", session, folder / "data", simulated=True, fast=True, **options)


def levels_of(path: Path, session: int = 1) -> list[tuple[int, str, float]]:
    """Return number, level and success of a session's counted trials that came to an end."""
    trials = open_recording(path).session(session).trials
    trials = trials[trials["outcome"].isin(["success", "timeout"])]
    columns = ("trial", "track_level", "track_success")
    return [tuple(row) for row in trials[list(columns)].itertuples(index=False)]


def ended(path: Path, session: int = 1) -> list[dict]:
    events = open_recording(path).session(session).events
    return events.loc[events["name"] == "track.end", "data"].tolist()


@pytest.mark.parametrize("text", [STAIRS, QUEST], ids=["stairs", "quest"])
def test_every_level_follows_from_the_responses_before_it(tmp_path: Path, text: str) -> None:
    where = visit(tmp_path, text)
    path = run(where, ScriptedConsole())
    track = where.study.protocol.design.tracks["reach"]
    told: list[tuple[str, bool]] = []
    seen = levels_of(path)
    assert len({level for _, level, _ in seen}) > 1
    for number, level, success in seen:
        if number % 3 == 2:  # the first of a round, after its approach
            assert level == standing(track, (), told).level
        told.append((level, bool(success)))
    (end,) = ended(path)
    assert end["ended"] == (standing(track, (), told).level is None)
    assert end["estimate"] == standing(track, (), told).estimate
    assert end["responses"] == len(told)


def test_a_success_is_what_the_measure_says(tmp_path: Path) -> None:
    path = run(visit(tmp_path, STAIRS), ScriptedConsole())
    trials = open_recording(path).session(1).trials
    assert ((trials["movement_time"] <= 7.0) == (trials["track_success"] == 1)).all()
    assert set(trials["track_success"]) == {0, 1}


def test_a_session_that_ends_by_its_rule_owes_nothing(tmp_path: Path) -> None:
    where = visit(tmp_path, STAIRS)
    path = run(where, ScriptedConsole())
    events = open_recording(path).session(1).events
    (end,) = events.loc[events["name"] == "session.end", "data"]
    assert (end["reason"], end["owed"]) == ("complete", "")
    whole = plan_session(where.study, "P001", 1)
    assert len(levels_of(path)) < len(whole.trials)
    so_far = progress(where.journal, where.study.machine.names)
    assert not remaining(where.study, whole, so_far, "redo_trial").steps


@pytest.mark.slow
@pytest.mark.parametrize("text", [STAIRS, QUEST], ids=["stairs", "quest"])
@pytest.mark.parametrize("dies_in", [1, 2, 5, 7, 9])
def test_a_killed_session_goes_on_as_if_it_had_not_been(
    tmp_path: Path, text: str, dies_in: int
) -> None:
    """Whatever the operator does otherwise then, each level follows from the record."""
    where = visit(tmp_path, text)
    with pytest.raises(DiesError):
        record(where, DiesInTrial(dies_in, ticks=5))
    before = [
        (each.level, bool(each.success))
        for each in progress(where.journal, where.study.machine.names).responses.values()
        if each.success is not None
    ]
    path = run(visit(tmp_path, text, resumed=True), ScriptedConsole())
    seen = levels_of(path)
    told = [(level, bool(success)) for _, level, success in seen]
    assert told[: len(before)] == before
    track = where.study.protocol.design.tracks["reach"]
    for at, (number, level, _) in enumerate(seen):
        if number % 3 == 2:
            assert level == standing(track, (), told[:at]).level
        else:
            assert level == seen[at - 1][1]  # the second of a round has the level of the first
    assert [number for number, _, _ in seen] == sorted({number for number, _, _ in seen})


def test_a_block_that_is_redone_begins_anew(tmp_path: Path) -> None:
    text = STAIRS + "on_fault: {session_died: redo_block}\n"
    where = visit(tmp_path, text)
    with pytest.raises(DiesError):
        record(where, DiesInTrial(8, ticks=5))
    path = run(visit(tmp_path, text, resumed=True), ScriptedConsole())
    trials = open_recording(path).session(1).trials
    again = trials[trials["attempt"] == 2]
    assert list(again["track_level"])[:2] == ["1m_far_left", "1m_far_left"]
    (end,) = ended(path)
    assert end["responses"] == len(again)


@pytest.mark.slow
@pytest.mark.parametrize("text", [STAIRS, QUEST], ids=["stairs", "quest"])
def test_the_next_session_goes_on_from_the_last_and_both_replay_to_the_bit(
    tmp_path: Path, text: str
) -> None:
    first = run(visit(tmp_path, text), ScriptedConsole())
    told = [(level, bool(success)) for _, level, success in levels_of(first)]
    path = run(visit(tmp_path, text, session=2), ScriptedConsole())
    track = visit(tmp_path, text).study.protocol.design.tracks["reach"]
    carried = open_recording(path).session(2).context["carried"]
    assert [(each["level"], each["success"]) for each in carried] == told
    seen = levels_of(path, 2)
    both = [*told, *((level, bool(success)) for _, level, success in seen)]
    for at, (number, level, _) in enumerate(seen):
        if number % 3 == 2:
            assert level == standing(track, told, both[len(told) : len(told) + at]).level
    (end,) = ended(path, 2)
    assert end["responses"] == len(both)
    for session in (1, 2):
        assert replay_session(path, session).difference is None


@pytest.mark.slow
def test_a_killed_second_session_carries_what_it_began_with(tmp_path: Path) -> None:
    run(visit(tmp_path, STAIRS), ScriptedConsole())
    with pytest.raises(DiesError):
        record(visit(tmp_path, STAIRS, session=2), DiesInTrial(5, ticks=5))
    path = run(visit(tmp_path, STAIRS, session=2, resumed=True), ScriptedConsole())
    told = [(level, bool(success)) for _, level, success in levels_of(path)]
    context = open_recording(path).session(2).context
    assert [(each["level"], each["success"]) for each in context["carried"]] == told


@pytest.mark.slow
def test_without_carrying_each_session_begins_anew(tmp_path: Path) -> None:
    text = STAIRS.replace("rounds: 8", "rounds: 8\n      carry: false")
    run(visit(tmp_path, text), ScriptedConsole())
    path = run(visit(tmp_path, text, session=2), ScriptedConsole())
    assert levels_of(path, 2)[0][1] == "1m_far_left"
    assert open_recording(path).session(2).context["carried"] == []


def test_a_level_that_is_gone_is_refused_before_the_next_session_begins(tmp_path: Path) -> None:
    run(visit(tmp_path, STAIRS), ScriptedConsole())
    less = STAIRS.replace("levels: {1m_far_left: 1, ", "levels: {")
    with pytest.raises(ProtocolError, match="had its level '1m_far_left', and it has 2m_far_left"):
        run(visit(tmp_path, less, session=2), ScriptedConsole())


@pytest.mark.slow
def test_a_skipped_trial_tells_nothing_and_a_repeated_one_keeps_its_level(tmp_path: Path) -> None:
    class Orders(ScriptedConsole):
        def commands(self):
            starts = [e.data for e in self.told if e.name == "trial.start"]
            last = (starts[-1]["trial"], starts[-1]["attempt"]) if starts else None
            given = {(2, 1): Order.SKIP, (3, 1): Order.REPEAT}.get(last)
            ends = [
                (e.data["trial"], e.data["attempt"]) for e in self.told if e.name == "trial.end"
            ]
            return [Command(given)] if given and last not in ends else []

    path = run(visit(tmp_path, STAIRS), Orders())
    trials = open_recording(path).session(1).trials
    told = trials.set_index(["trial", "attempt"])["track_success"]
    assert told[2, 1] != told[2, 1]
    assert told[3, 1] != told[3, 1]
    levels = trials.set_index(["trial", "attempt"])["track_level"]
    assert levels[3, 1] == levels[3, 2] == "1m_far_left"
    assert replay_session(path, 1).difference is None


def test_a_plan_says_what_it_can_of_levels_that_are_not_chosen_yet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(QUEST)
    assert main(["plan", str(path), "--participant", "P001"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "at most 16 trials" in said
    assert "pairs by track 'reach' (QUEST+), from 1m_far_left to 4m_far_left, 8 rounds" in said
    assert main(["plan", str(path), "--participant", "P001", "--json"]) == 0
    block = json.loads(capsys.readouterr().out)["sessions"][0]["blocks"][0]
    assert block["track"]["rounds"] == 8
    assert block["track"]["levels"]["4m_far_left"] == 4.0
    assert block["levels"] == {}


def test_a_codebook_has_the_columns_of_a_track(tmp_path: Path) -> None:
    path = run(visit(tmp_path, STAIRS), ScriptedConsole())
    study = visit(tmp_path, STAIRS).study
    names = {column.name for column in codebook(study) if column.table == "trials"}
    assert {"track", "track_level", "track_success"} <= names
    assert set(open_recording(path).session(1).trials.columns) <= names | {"counted"}


@pytest.mark.slow
@needs("numba")
def test_compiled_kernels_and_the_loop_choose_the_same_levels(tmp_path: Path) -> None:
    protocol = tmp_path / "protocol.yaml"
    protocol.write_text(STAIRS)
    by_kernels = simulate(SimulationJob(protocol, None, tmp_path / "kernels", "P001"))
    by_loop = simulate(SimulationJob(protocol, None, tmp_path / "loop", "P001", loop="asked for"))
    assert json.loads((by_kernels.path / "simulated_by.json").read_text())[0]["compiled"]
    for number in (1, 2):
        name = f"ses-{number:02}_run.xdf"
        assert (by_kernels.path / name).read_bytes() == (by_loop.path / name).read_bytes()
