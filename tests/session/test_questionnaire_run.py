"""Questionnaires within a session: every answer is an event at once."""

import json
from pathlib import Path

import pytest
from rehearsal import SHORT, Rehearsal, ScriptedConsole, a_study, rehearse, simulated_file

from labcrane import open_recording
from labcrane.testing import Command, Order, Study, Visit, main, run

HEAD = SHORT.partition("sessions:")[0]
RATINGS = """\
stop_rules: [{questionnaire: subjective_accuracy, score: share, above: 0.8}]
sessions:
  - name: only
    steps:
      - questionnaire: subjective_accuracy
      - questionnaire: [situational_awareness]
"""


def ratings(folder: Path) -> Study:
    return a_study(folder, HEAD + RATINGS)


def answer(questionnaire: str, value: object, item: str = "rating", by: str = "") -> Command:
    given = {"questionnaire": questionnaire, "item": item, "value": value}
    return Command(Order.ANSWER, json.dumps(given), by)


def play(study: Study, *orders: Command) -> Rehearsal:
    """Give one order at every second tick, and end the session after the last."""
    script = {2 * at: [order] for at, order in enumerate((*orders, Command(Order.END)), start=1)}
    return rehearse(study, script, waits=True)


SUBMIT = Command(Order.SUBMIT)


def test_an_answer_is_an_event_in_the_tick_in_which_it_comes(tmp_path: Path) -> None:
    seen = play(ratings(tmp_path), answer("subjective_accuracy", 7, by="participant"))
    [event] = seen.events("questionnaire.answer")
    assert event.data["value"] == 7.0
    assert event.data["by"] == "participant"
    assert event in seen.frames[2].events


def test_a_wrong_answer_is_refused_with_what_is_possible_and_a_right_one_follows(
    tmp_path: Path,
) -> None:
    wrong, right = answer("subjective_accuracy", 11), answer("subjective_accuracy", 7)
    seen = play(ratings(tmp_path), wrong, SUBMIT, right, SUBMIT)
    why = [event.data["why"] for event in seen.events("questionnaire.refused")]
    assert why == [
        "item 'rating' takes 0 to 10 in steps of 1: 0 Not at all, 10 Perfectly, not 11",
        "rating have no answer; answer or decline them",
    ]
    end = seen.events("questionnaire.end")[0].data
    assert (end["handed_in"], end["score.share"], end["missing"]) == (True, 0.7, 0)
    assert seen.events("questionnaire.start")[1].data["questionnaire"] == "situational_awareness"


def test_an_answer_to_another_questionnaire_or_none_is_refused(tmp_path: Path) -> None:
    other = answer("situational_awareness", 3)
    unknown = answer("subjective_accuracy", 3, item="speed")
    noise = Command(Order.ANSWER, "{")
    seen = play(ratings(tmp_path), other, unknown, noise)
    why = [event.data["why"] for event in seen.events("questionnaire.refused")]
    assert why[0].startswith("an answer needs questionnaire 'subjective_accuracy', item and value")
    assert why[1] == "subjective_accuracy has no item 'speed'; it has rating"
    assert len(why) == 3
    assert not seen.events("questionnaire.answer")


def test_an_answer_that_names_a_person_is_refused_and_not_written_down(tmp_path: Path) -> None:
    questions = "[{name: why, text: Why?, kind: text}]"
    more = f"questionnaires: {{own: {{use: free, title: Own, questions: {questions}}}}}\n"
    steps = "sessions:\n  - name: only\n    steps:\n      - questionnaire: own\n"
    study = a_study(tmp_path, HEAD + more + steps)
    seen = play(study, answer("own", "ask jane.doe@example.org", item="why"))
    [refused] = seen.events("questionnaire.refused")
    assert "an answer must not contain" in refused.data["why"]
    assert not any("jane" in str(event.data) for frame in seen.frames for event in frame.events)


def test_a_question_can_be_declined_and_then_has_no_score(tmp_path: Path) -> None:
    seen = play(ratings(tmp_path), answer("subjective_accuracy", None), SUBMIT)
    end = seen.events("questionnaire.end")[0].data
    assert (end["handed_in"], end["score.share"], end["missing"]) == (True, None, 1)


def test_a_score_above_the_limit_pauses_until_the_examiner_says_go(tmp_path: Path) -> None:
    high = answer("subjective_accuracy", 9)
    seen = play(ratings(tmp_path), high, SUBMIT, Command(Order.START))
    [met] = seen.events("stop_rule.met")
    assert (met.data["value"], met.data["above"]) == (0.9, 0.8)
    assert seen.events("pause.start")[0].data["by"] == "stop rule"
    assert seen.events("pause.end")[0].data["by"] == "stop rule"
    assert not seen.events("participant.dropout")
    assert seen.events("questionnaire.start")[1].data["questionnaire"] == "situational_awareness"


def test_ending_a_session_that_a_rule_has_stopped_is_a_dropout(tmp_path: Path) -> None:
    seen = play(ratings(tmp_path), answer("subjective_accuracy", 9), SUBMIT)
    assert len(seen.events("participant.dropout")) == 1
    assert len(seen.events("questionnaire.start")) == 1


def test_a_score_at_the_limit_stops_nobody(tmp_path: Path) -> None:
    seen = play(ratings(tmp_path), answer("subjective_accuracy", 8), SUBMIT)
    assert not seen.events("stop_rule.met")


def test_ratings_after_each_trial_name_their_trial(tmp_path: Path) -> None:
    block = "block: {task: aiming, pairs: 1, ask: [subjective_accuracy]}"
    study = a_study(tmp_path, SHORT.replace("block: {task: aiming, pairs: 1}", block))
    seen = rehearse(study)
    trials = [trial["trial"] for trial in seen.trials()]
    ends = seen.events("questionnaire.end")
    assert [event.data["trial"] for event in ends] == trials == [2, 3]
    assert all(0.0 <= event.data["score.share"] <= 1.0 for event in ends)


def test_answers_of_a_simulation_are_replayed(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    file = simulated_file(tmp_path, f"{HEAD}{RATINGS}")
    assert main(["replay", str(file), "--session", "1"]) == 0, capsys.readouterr().out


def test_simulated_people_do_not_answer_alike_in_every_session(tmp_path: Path) -> None:
    asks = "    steps:\n      - questionnaire: subjective_accuracy\n"
    sessions = "".join(f"  - name: day {day}\n{asks}" for day in range(1, 6))
    study = a_study(tmp_path, HEAD + "sessions:\n" + sessions)
    given = []
    for session in range(1, 6):
        visit = Visit(study, "P001", session, tmp_path / "data", simulated=True, fast=True)
        file = run(visit, ScriptedConsole())
        rows = open_recording(file).session(session).questionnaires
        given += rows["value"][rows["item"] == "rating"].tolist()
    assert len(given) == 5
    assert len(set(given)) > 1
