"""Who is given which feedback, what may be changed of it, and what its processes are told."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fed_study import FED
from rehearsal import SHORT, ScriptedConsole, a_study, rehearse

import labcrane
from labcrane import ProtocolError, Signal
from labcrane.core import Event, Layout, SessionState, TargetFinder
from labcrane.design.order import faded
from labcrane.protocol.questions import CheckQuestion, questions
from labcrane.recording.run_codec import read_run, write_run
from labcrane.session.commands import FeedbackLost, FeedbackReady
from labcrane.streams.context import situation_after
from labcrane.testing import TARGETS, Command, Order, Study, Visit, ch8, make_run, plan_session, run


def blocks(*written: str) -> str:
    head, _, _ = FED.partition("      - block")
    return head + "".join(f"      - block: {{task: aiming, {block}}}\n" for block in written)


def given(study: Study, slot: int = 1) -> list[list[tuple[str, ...]]]:
    plan = plan_session(study, f"P{slot:03}", 1, slot)
    return [
        [block.feedback[t.number] for t in block.trials if t.planned.counted]
        for block in plan.blocks
    ]


@pytest.mark.parametrize(
    ("count", "shares", "expected"),
    [
        (4, (1.0,), "1111"),
        (4, (0.5,), "1010"),
        (6, (0.3,), "100100"),
        (12, (1.0, 0.5, 0.0), "111110100000"),
        (5, (0.0,), "00000"),
    ],
)
def test_feedback_fades_part_by_part(count: int, shares: tuple[float, ...], expected: str) -> None:
    assert "".join(str(int(on)) for on in faded(count, shares)) == expected


def of_design(study: Study) -> list[CheckQuestion]:
    """Return what is asked about who is given which feedback; this study has no view for cues."""
    return [each for each in questions(study) if not each.key.startswith("feedback.")]


def test_check_warns_of_a_block_that_gives_every_group_all_feedback_unsaid(tmp_path: Path) -> None:
    said = of_design(a_study(tmp_path, blocks("pairs: 1", "pairs: 1, feedback: group")))
    asked, order = sorted(said, key=lambda each: each.key)
    assert "differ in feedback and come in this order for everyone" in order.text
    assert asked.text.startswith("sessions: step 1 of ")
    assert "so that every group is given ball, tone; write feedback: group, none, all" in asked.text
    said = of_design(a_study(tmp_path, blocks("pairs: 1, feedback: all")))
    assert [each.key for each in said] == [
        "design.groups",  # which then do the same
        "sessions.1.steps.1.block.feedback",
    ]
    assert "'ball' to 'none', 'auditory'; 'tone' to 'none', 'visual'" in said[1].text


def test_a_block_says_what_is_switched_on(tmp_path: Path) -> None:
    study = a_study(
        tmp_path,
        blocks("pairs: 1", "pairs: 1, feedback: none", "pairs: 1, feedback: [tone]"),
    )
    both = ("ball", "tone")
    assert given(study) == [[both] * 2, [()] * 2, [("tone",)] * 2]


def test_a_group_is_given_its_feedback(tmp_path: Path) -> None:
    study = a_study(tmp_path, blocks("pairs: 1, feedback: group"))
    got = {given(study, slot)[0][0] for slot in range(1, 5)}
    assert got == {(), ("ball",), ("tone",), ("ball", "tone")}


def test_a_fading_block_takes_feedback_away(tmp_path: Path) -> None:
    study = a_study(tmp_path, blocks("fading: [1, 0.5, 0]", "feedback: none"))
    trials = given(study)[0]
    assert trials[0]
    assert not trials[-1]


def test_what_was_switched_on_is_in_the_trial_table(tmp_path: Path) -> None:
    study = a_study(tmp_path, blocks("pairs: 1", "pairs: 1, feedback: none"))
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    session = labcrane.open_recording(run(visit, ScriptedConsole())).session(1)
    assert session.trials["feedback"].tolist() == ["ball+tone"] * 2 + ["none"] * 2
    assert session.context["components"]["feedback.tone"]["settings"]["far"] == 3.0


@pytest.mark.parametrize(
    ("written", "complaint"),
    [
        (
            blocks("feedback: [bell]"),
            "there is no feedback 'bell'; did you mean 'ball'? there is ball, tone",
        ),
        (blocks("fading: [2]"), "must be less than or equal to 1"),
        (FED + "views: {ball: {use: view}}\n", "'ball' is already the name of a feedback"),
        (
            SHORT.replace("pairs: 1", "feedback: group"),
            "feedback is by group, but design has no groups; write them under design:",
        ),
    ],
)
def test_a_protocol_that_asks_for_the_impossible_is_refused(
    written: str, complaint: str, tmp_path: Path
) -> None:
    with pytest.raises(ProtocolError, match=re.escape(complaint)):
        a_study(tmp_path, written)


def test_a_changed_setting_is_an_event(tmp_path: Path) -> None:
    study = a_study(tmp_path, FED)
    seen = rehearse(study, {5: [Command(Order.SETTING, "ball.at=tip")]})
    (event,) = seen.events("feedback.setting")
    assert event.data == {"feedback": "ball", "key": "at", "value": "tip"}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("ball", "a setting is written name.key=value, not 'ball'"),
        ("bell.far=1", "there is no feedback 'bell'; there is ball, tone"),
        ("tone.fat=1", "tone has no setting 'fat'; it has far, "),
        ("tone.far=-1", "tone.far cannot be -1: Input should be greater than 0"),
        ("tone.far=[1, 2]", "the setting contains '['; write one plain value in one line"),
    ],
)
def test_a_setting_that_cannot_be_is_refused(text: str, why: str, tmp_path: Path) -> None:
    seen = rehearse(a_study(tmp_path, FED), {5: [Command(Order.SETTING, text)]})
    (order,) = seen.events("order.setting")
    assert str(order.data["refused"]).startswith(why)
    assert not seen.events("feedback.setting")


@pytest.mark.slow
def test_a_failed_process_pauses_the_session_if_the_protocol_says_so(tmp_path: Path) -> None:
    orders = {
        50: [FeedbackLost("tone", "it hangs")],
        90: [FeedbackReady("tone", "driver jack")],
    }
    pausing = FED + "on_fault: {feedback_lost: pause}\n"
    seen = rehearse(a_study(tmp_path, pausing), orders)
    (lost,) = seen.events("feedback.lost")
    assert lost.data == {
        "what": "tone", "why": "it hangs", "left_out": False, "attempt": 0, "attempts": 0,
    }  # fmt: skip
    (ready,) = seen.events("feedback.ready")
    assert ready.data == {"what": "tone", "facts": "driver jack"}
    assert [frame.paused for frame in seen.frames[48:92]].count(True) == 40
    calm = rehearse(a_study(tmp_path, FED), orders)
    assert not any(frame.paused for frame in calm.frames)


def test_a_scene_comes_through_as_it_was() -> None:
    a = replace(make_run(ch8(), task=TARGETS), bodies=())
    b = read_run(write_run(a))
    assert (a.machine, a.rate_hz, a.axes, a.command, a.state, a.task, a.bodies) == (
        *(b.machine, b.rate_hz, b.axes, b.command, b.state, b.task, b.bodies),
    )
    with pytest.raises(labcrane.PluginError, match="feedback was asked to steer"):
        b.inverse(np.zeros(3), np.zeros(3))


def test_the_situation_follows_from_events() -> None:
    now = SessionState(trials=2)
    events = [
        Event("step.start", 1.0, {"step": 1, "kind": "block"}),
        Event("block.start", 1.0, {"block": 1, "block_name": "a", "practice": False}),
        Event("trial.start", 1.0, {"trial": 1, "feedback": "ball+tone"}),
        Event("feedback.setting", 2.0, {"feedback": "ball", "key": "far", "value": 2.0}),
    ]
    for event in events:
        now = situation_after(now, event, {1: 2})
    assert now.counted == 2
    assert (now.step, now.block_name, now.trial, now.active) == (1, "a", 1, ("ball", "tone"))
    assert now.settings == {"ball": {"far": 2.0}}
    after = situation_after(now, Event("trial.end", 3.0, {}))
    assert (after.trial, after.active, after.settings) == (0, (), now.settings)


def test_the_situation_says_what_the_operator_is_to_read() -> None:
    now = SessionState()
    hint = {"text": "slower", "refused": None, "by": "x"}
    for event, text, asked, said in (
        (Event("instructions.shown", 1.0, {"text": "go"}), "go", "", ""),
        (Event("order.hint", 2.0, hint), "go", "", "slower"),
        (Event("order.hint", 3.0, {**hint, "refused": "words"}), "go", "", "slower"),
        (Event("step.end", 4.0, {"step": 1, "kind": "instructions"}), "", "", "slower"),
        (Event("questionnaire.start", 5.0, {"title": "Workload"}), "", "Workload", "slower"),
        (Event("questionnaire.end", 6.0, {"handed_in": True}), "", "", "slower"),
    ):
        now = situation_after(now, event)
        assert (now.text, now.questionnaire, now.hint) == (text, asked, said)
    assert now.hint_time == 2.0


def test_the_situation_says_why_nobody_is_to_move() -> None:
    now = SessionState()
    ended = {"step": 1, "kind": "block", "done": True}
    for name, data, held, waiting, over in (
        ("waiting", {"what": "first"}, (), "first", ""),
        ("pause.start", {"by": "input"}, ("input",), "first", ""),
        ("pause.start", {"by": "examiner"}, ("input", "examiner"), "first", ""),
        ("pause.start", {"by": "input"}, ("input", "examiner"), "first", ""),
        ("pause.end", {"by": "input"}, ("examiner",), "first", ""),
        ("pause.end", {"by": "examiner"}, (), "first", ""),
        ("block.start", {"block": 1, "block_name": "a", "practice": False}, (), "", ""),
        ("break.start", {"seconds": 9.0}, (), "break", ""),
        ("break.end", {"left": 0.0}, (), "", ""),
        ("waiting", {"what": "instructions"}, (), "instructions", ""),
        ("step.end", ended, (), "", ""),
        ("pause.start", {"by": "input"}, ("input",), "", ""),
        ("session.end", {"reason": "by order", "owed": "trial 2"}, ("input",), "", "by order"),
        ("session.start", {"study": "a"}, (), "", ""),
        ("session.end", {"reason": "complete", "owed": ""}, (), "", "complete"),
    ):
        now = situation_after(now, Event(name, 1.0, data))
        assert (now.held, now.waiting, now.over) == (held, waiting, over), name


def test_targets_are_found_among_a_tasks_signals() -> None:
    task = Layout("the task", (*TARGETS, Signal("cost", "1")))
    found = list(TargetFinder(task).find(np.array([1.0, 2.0, 3.0, 0.5, 4.0, 5.0, 6.0, 9.0])))
    assert [(ball.name, ball.centre, ball.radius) for ball in found] == [
        ("target", (1.0, 2.0, 3.0), 0.5),
        ("other", (4.0, 5.0, 6.0), 0.5),
    ]
    assert not list(TargetFinder(task).find(np.full(8, np.nan)))
