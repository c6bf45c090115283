"""What a session does with orders and faults, tick by tick."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rehearsal import SHORT, a_study, rehearse

from labcrane import Frame, InputDevice
from labcrane.core import Phase
from labcrane.protocol.protocol import OnFault
from labcrane.protocol.rig import Rig
from labcrane.session.commands import FeedbackLost, FeedbackReady
from labcrane.testing import Command, Order, Study


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return a_study(tmp_path)


def give(order: Order, text: str = "") -> list[Command]:
    return [Command(order, text)]


def test_an_undisturbed_session_runs_its_plan(study: Study) -> None:
    seen = rehearse(study)
    assert [t["trial"] for t in seen.trials()] == [2, 3]  # trial 1 is the approach
    assert all(t["outcome"] == "success" for t in seen.trials())
    assert [n for n in seen.names if n.split(".")[0] in {"step", "block", "session", "trial"}] == [
        "step.start",
        "block.start",
        *["trial.start", "trial.end"] * 3,
        "block.end",
        "step.end",
        "session.end",
    ]


def test_every_event_is_stamped_within_its_session_and_in_the_tick_it_tells_of(
    study: Study,
) -> None:
    seen = rehearse(study)
    for frame in seen.frames:
        for event in frame.events:
            if event.name in {"movement.onset", "movement.offset"}:  # known only afterwards
                assert event.time <= frame.tick.due
            else:
                assert event.time == frame.tick.due


def test_elapsed_counts_the_ticks_of_a_trial(study: Study) -> None:
    seen = rehearse(study)
    for number in (1, 2, 3):
        elapsed = [frame.elapsed for frame in seen.frames if frame.trial == number]
        np.testing.assert_allclose(elapsed, np.arange(len(elapsed)) / 240.0, rtol=0, atol=1e-12)


def test_the_last_frame_of_a_trial_is_not_that_of_the_next_ones_start(
    study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    pose = (0.5, 0.3, -0.4, 0.2)
    task = study.tasks["aiming"]
    plan = task.plan
    monkeypatch.setattr(
        task, "plan", lambda *about: [replace(each, start_pose=pose) for each in plan(*about)]
    )
    seen = rehearse(study, {number: give(Order.SKIP) for number in (240, 480)})
    ends = [at for at, frame in enumerate(seen.frames) if "trial.end" in names_of(frame)]
    assert ends[:2] == [240, 480]
    for at in ends[:2]:
        assert "trial.start" in names_of(seen.frames[at + 1])
        moved = np.abs(seen.frames[at].state[:4] - seen.frames[at - 1].state[:4])
        assert moved.max() < 0.02, "a tick's way, and no jump"
        assert (seen.frames[at].state[:4] != pose).any()
        np.testing.assert_allclose(seen.frames[at + 1].state[:4], pose, rtol=0, atol=0.02)


def names_of(frame: Frame) -> list[str]:
    return [event.name for event in frame.events]


@pytest.mark.slow
def test_a_pause_holds_the_machine_and_the_trials_clock(study: Study) -> None:
    plain = rehearse(study)
    seen = rehearse(study, {200: give(Order.PAUSE), 500: give(Order.START)})
    held = seen.frames[200:500]
    assert all(frame.paused and not frame.command[:4].any() for frame in held)
    assert {frame.elapsed for frame in held} == {seen.frames[200].elapsed}
    assert np.ptp([frame.state[:4] for frame in held], axis=0).max() == 0.0
    assert [e.data["by"] for e in seen.events("pause.start")] == ["examiner"]
    (approach, *_) = seen.events("trial.end")
    assert approach.data["paused"] == pytest.approx(300 / 240)
    assert len(plain.trials()) == len(seen.trials())


@pytest.mark.slow
def test_a_repeated_trial_is_kept_and_run_again_as_a_new_attempt(study: Study) -> None:
    first = rehearse(study)
    start = next(n for n, frame in enumerate(first.frames) if frame.trial == 2)
    seen = rehearse(study, {start + 50: give(Order.REPEAT)})
    rows = [(t["trial"], t["attempt"], t["outcome"]) for t in seen.trials()]
    assert rows == [(2, 1, "repeated"), (2, 2, "success"), (3, 1, "success")]
    seeds = {t["seed"] for t in seen.trials()}
    assert len(seeds) == 3


def test_a_skipped_trial_is_a_row_without_results(study: Study) -> None:
    first = rehearse(study)
    start = next(n for n, frame in enumerate(first.frames) if frame.trial == 2)
    seen = rehearse(study, {start + 50: give(Order.SKIP)})
    row = seen.trials()[0]
    assert row["outcome"] == "skipped"
    assert row["movement_time"] is None
    assert [t["trial"] for t in seen.trials()] == [2, 3]


def test_an_ended_session_says_so_and_ends_its_trial(study: Study) -> None:
    seen = rehearse(study, {300: give(Order.END)})
    assert seen.frames[-1].tick.number <= 301
    assert seen.events("trial.end")[-1].data["outcome"] == "ended"
    assert seen.events("session.end")[0].data["reason"] == "by order"


def test_an_order_that_makes_no_sense_is_refused_in_words(study: Study) -> None:
    seen = rehearse(study, {5: give(Order.START), 6: give(Order.NOTE), 7: give(Order.COMPLETION)})
    assert seen.events("order.start")[0].data["refused"] == "nothing is waiting to start"
    assert seen.events("order.note")[0].data["refused"] == "a note needs words"
    assert seen.events("order.completion")[0].data["refused"] == "completion is 1 or 0, not ''"


def test_what_no_task_asks_about_cannot_be_reported_nor_anything_before_a_trial(
    study: Study,
) -> None:
    orders = {5: give(Order.REPORT, "fire"), 40: give(Order.START), 60: give(Order.REPORT, "fire")}
    before, within = rehearse(study, orders, waits=True).events("order.report")
    assert before.data["refused"] == "no trial is running"
    assert within.data["refused"] == "this task asks for reports of nothing"


@pytest.mark.slow
def test_a_test_that_has_ended_is_judged_until_the_next_begins(tmp_path: Path) -> None:
    text = SHORT.replace("task: aiming", "task: aiming, ask: [subjective_accuracy]")
    study = a_study(tmp_path, text)
    ended = next(
        number
        for number, frame in enumerate(rehearse(study).frames)
        for event in frame.events
        if event.name == "trial.end" and event.data["counted"]
    )
    orders = {ended + 1: [*give(Order.COMPLETION, "0"), *give(Order.OVERRIDE)]}
    seen = rehearse(study, orders)
    (late,) = seen.events("order.completion")
    (override,) = seen.events("order.override")
    row = next(row for row in seen.trials() if row["counted"])
    for order in (late, override):
        told = (order.data["refused"], order.data["trial"], order.data["after"])
        assert told == (None, row["trial"], True)
    assert row["completion"] is None  # as it ended; the participant file has what was set


def test_an_overridden_trial_outlasts_its_limit(tmp_path: Path) -> None:
    text = SHORT.replace("movements: 2", "movements: 2, limit_s: 0.5")
    study = a_study(tmp_path, text)
    assert {t["outcome"] for t in rehearse(study).trials()} == {"timeout"}
    seen = rehearse(study, {3: give(Order.OVERRIDE)})
    approach, outward, _inward = seen.events("trial.end")
    assert approach.data["outcome"] == "success"
    assert outward.data["outcome"] == "timeout"  # it holds for one trial


def test_people_are_waited_for(tmp_path: Path) -> None:
    text = SHORT.replace("- block:", "- instructions: hello.md\n      - block:")
    (tmp_path / "hello.md").write_text("Welcome", encoding="utf-8")
    study = a_study(tmp_path, text)
    seen = rehearse(study, {40: give(Order.START), 90: give(Order.START)}, waits=True)
    assert [e.data["what"] for e in seen.events("waiting")] == ["instructions", "aiming"]
    waiting = seen.frames[:90]
    assert all(frame.phase is Phase.IDLE and not frame.command[:4].any() for frame in waiting)
    assert np.isnan([frame.task for frame in waiting]).all()
    assert seen.frames[92].trial == 1


def test_no_step_begins_before_all_feedback_presents_or_is_left_out(study: Study) -> None:
    orders = {
        20: [FeedbackLost("tone", "it hangs")],
        40: [FeedbackReady("screen", "renderer software")],
        60: [FeedbackLost("tone", "it hangs", left_out=True)],
    }
    seen = rehearse(study, orders, awaits=("screen", "tone"))
    assert [event.data["what"] for event in seen.events("feedback.awaited")] == ["screen", "tone"]
    assert {event.name for frame in seen.frames[:60] for event in frame.events} == {
        "feedback.awaited",
        "feedback.lost",
        "feedback.ready",
    }
    (started,) = seen.events("step.start")
    assert started.time == pytest.approx(seen.frames[61].tick.due)
    assert [lost.data["left_out"] for lost in seen.events("feedback.lost")] == [False, True]
    assert len(seen.trials()) == 2


@pytest.mark.parametrize(
    ("rule", "waits", "held"),
    [("restart", True, True), ("pause", True, True), ("continue", True, False),
     ("restart", False, False)],
)  # fmt: skip
def test_a_person_moves_nothing_before_a_view_that_never_came_is_decided_on(
    study: Study, *, rule: str, waits: bool, held: bool
) -> None:
    on_fault = OnFault(feedback_lost=rule)
    study = replace(study, protocol=study.protocol.model_copy(update={"on_fault": on_fault}))
    orders = {
        20: [FeedbackLost("screen", "it is black", left_out=True)],
        40: give(Order.START),
        60: [Command(Order.WITHOUT, "screen"), *give(Order.START)],
    }
    seen = rehearse(study, orders, waits=waits, awaits=("screen",))
    assert [event.data["by"] for event in seen.events("pause.start")] == (
        ["feedback screen"] if held else []
    )
    begun = [number for number, frame in enumerate(seen.frames) if frame.trial]
    assert (begun[0] >= 60) == held
    assert bool(seen.events("order.start")[0].data["refused"]) == (held or not waits)
    assert len(seen.trials()) == 2


def test_a_session_ended_while_it_waits_for_feedback_begins_no_step(study: Study) -> None:
    seen = rehearse(study, {20: give(Order.END)}, awaits=("screen",))
    assert not seen.events("step.start")
    assert seen.names[-1] == "session.end"


@pytest.mark.slow
def test_a_break_lasts_as_written_or_until_it_is_skipped(tmp_path: Path) -> None:
    text = SHORT.replace("- block:", "- break: {seconds: 2}\n      - block:")
    study = a_study(tmp_path, text)
    for orders, ticks, left in (({}, 480, 0.0), ({100: give(Order.SKIP)}, 100, 380 / 240)):
        seen = rehearse(study, orders)
        start, end = seen.events("break.start")[0], seen.events("break.end")[0]
        assert (end.time - start.time) * 240 == pytest.approx(ticks, abs=1.01)
        assert end.data["left"] == pytest.approx(left, abs=1.01 / 240)


class Unplugged:
    """An input device whose plug is pulled between two ticks."""

    def __init__(self, device: InputDevice, out: int, back: int) -> None:
        self._device, self._gone = device, range(out, back)

    def __getattr__(self, name: str) -> object:
        return getattr(self._device, name)

    def read(self, tick, seen):
        self.fault = "the left stick is unplugged" if tick.number in self._gone else None
        axes = self._device.read(tick, seen)
        return np.zeros_like(axes) if self.fault else axes


def test_lost_input_stops_the_machine_at_once_and_goes_on_when_it_is_back(study: Study) -> None:
    rig = Rig.build(study, simulated=True)
    rig = replace(rig, input=Unplugged(rig.input, 300, 400))
    seen = rehearse(study, rig=rig)
    assert seen.events("input.lost")[0].data["why"] == "the left stick is unplugged"
    assert seen.events("input.lost")[0].time == seen.frames[300].tick.due
    assert all(frame.paused and not frame.command[:4].any() for frame in seen.frames[300:400])
    assert seen.events("input.back")[0].time == seen.frames[400].tick.due
    assert not seen.frames[400].paused
    assert all(t["outcome"] == "success" for t in seen.trials())


def test_lost_input_ends_the_session_when_the_protocol_says_so(tmp_path: Path) -> None:
    study = a_study(tmp_path, SHORT + "on_fault: {input_lost: end}\n")
    rig = Rig.build(study, simulated=True)
    rig = replace(rig, input=Unplugged(rig.input, 300, 400))
    seen = rehearse(study, rig=rig)
    assert seen.events("session.end")[0].data["reason"] == "input lost"
    assert seen.frames[-1].tick.number <= 301


PAUSING = "on_fault: {feedback_lost: pause}\n"
GONE = FeedbackLost("tone", "it hangs", left_out=True, attempts=3)


@pytest.mark.parametrize("back", [True, False])
def test_a_session_held_for_a_sound_begins_nothing_and_goes_on_with_it_or_without(
    tmp_path: Path, *, back: bool
) -> None:
    orders = {
        20: [GONE],
        40: give(Order.START),  # would begin a movement that is held
        60: [Command(Order.AGAIN, "tone")],
        80: [GONE],
        90: [Command(Order.AGAIN, "bell")],
        100: [FeedbackReady("tone")] if back else [Command(Order.WITHOUT, "tone")],
        110: [GONE],  # gone again: waited for only where it had come back
        111: [Command(Order.WITHOUT, "tone")],
        120: give(Order.START),
    }
    seen = rehearse(a_study(tmp_path, SHORT + PAUSING), orders, waits=True)
    refused = {name: [e.data["refused"] for e in seen.events(name)]
               for name in ("order.start", "order.again", "order.without")}  # fmt: skip
    assert refused == {
        "order.start": [
            "stopped by a fault, and a movement would be held: feedback tone",
            None,
        ],
        "order.again": [
            None,
            "again names a view or sound that has failed (tone), not 'bell'",
        ],
        "order.without": [None] * (1 if back else 2),
    }
    assert len(seen.events("pause.start")) == len(seen.events("pause.end")) == (2 if back else 1)
    assert len(seen.trials()) == 2


def test_a_session_goes_on_without_a_view_until_it_is_asked_for_again(study: Study) -> None:
    """One that shows a few pictures and fails held it again each time."""
    on_fault = OnFault(feedback_lost="pause")
    study = replace(study, protocol=study.protocol.model_copy(update={"on_fault": on_fault}))
    fails = [FeedbackLost("screen", "it hangs")]
    orders = {
        20: [FeedbackReady("screen", "")],
        40: fails,
        60: [Command(Order.WITHOUT, "screen")],
        80: [FeedbackReady("screen", "")],
        100: fails,
        120: [FeedbackLost("screen", "it hangs", left_out=True)],
        140: [Command(Order.AGAIN, "screen")],
        160: [FeedbackReady("screen", "")],
        180: fails,
        200: [FeedbackReady("screen", "")],
    }
    seen = rehearse(study, orders, awaits=("screen",))
    paused = [number for number, frame in enumerate(seen.frames) if frame.paused]
    assert paused == [*range(40, 60), *range(180, 200)]
