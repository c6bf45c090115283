"""The control room, from events to what is shown: states, lamp, buttons, sliders, sentences."""

import json
import random
import re
import threading
import time
from pathlib import Path
from textwrap import indent
from types import SimpleNamespace

import pylsl
import pytest
from faults.sessions import wait_for
from governed import TODAY, Lab
from pages.room import STUDY
from rehearsal import loaded

from labcrane.cli.terminal import KEYS as TERMINAL_KEYS
from labcrane.core import Event
from labcrane.core.events import KINDS
from labcrane.participants.enrolment import exclude
from labcrane.session.commands import SettingChange, read_request
from labcrane.session.live_settings import FeedbackSettings
from labcrane.streams.recorder.candidates import answered
from labcrane.testing import Command, Order, ch8, plan_session
from labcrane.web import handle
from labcrane.web.control_room import shown
from labcrane.web.control_room.bars import groups
from labcrane.web.control_room.buttons import about_failed, answers, buttons
from labcrane.web.control_room.condition import (
    STATES,
    ExpectedSession,
    Lamp,
    handled,
    lamp_of,
    state_of,
)
from labcrane.web.control_room.earlier import FEWEST, Earlier, read_behind
from labcrane.web.control_room.sentences import FILTERS, sentence
from labcrane.web.control_room.shown import ShownShapes
from labcrane.web.control_room.sliders import sliders
from labcrane.web.control_room.snapshot import Snapshot, clock
from labcrane.web.examiner_page import KEYS
from labcrane.web.live import Live
from labcrane.web.pictures import Pictures
from labcrane.web.service import Opened, PageConfig, Streams
from labcrane.web.state import SessionLeft, SessionView
from labcrane_sonification.settings import SonificationSettings
from labcrane_sphere.settings import SphereSettings

README = Path(__file__).parents[2] / "README.md"
TRIAL = {"trial": 1, "attempt": 1, "counted": True}
EXPECTED = ExpectedSession(1 / 240, ["operator"])


class Punctual:
    """A loop that is in time."""

    lateness_s: float | None = 0.0
    silent_s: float | None = 0.0


def after(*events: tuple[str, dict]) -> SessionView:
    view = SessionView()
    for at, (name, data) in enumerate(events):
        view.take(Event(name, float(at), data))
    return view


BEGUN = {
    "starting": (),
    "consent": (("consent.needed", {"file": "c.txt", "version": "a", "text": ""}),),
    "waiting": (("waiting", {"what": "aiming"}),),
    "running": (("trial.start", TRIAL),),
    "paused": (("trial.start", TRIAL), ("pause.start", {"by": "examiner"})),
    "fault": (("input.lost", {"why": "gone"}), ("pause.start", {"by": "input"})),
    "break": (("break.start", {"seconds": 60}),),
    "fixation": (("fixation.shown", {"point": 2, "x": 0.15, "y": 0.15}),),
    "questionnaire": (
        ("questionnaire.start", {"questionnaire": "kss", "title": "Sleep", "kept": "{}"}),
    ),
    "decision": (
        ("stop_rule.met", {"questionnaire": "ssq", "score": "x", "value": 9, "above": 5}),
        ("pause.start", {"by": "stop rule"}),
    ),
    "judgement": (("judgement.awaited", {"trial": 1, "attempt": 1}),),
    "between": (("trial.start", TRIAL), ("step.end", {"step": 1, "done": True})),
    "ended": (("session.end", {"reason": "complete", "owed": ""}),),
}


def test_every_state_is_reached_by_what_a_session_says() -> None:
    assert set(BEGUN) == set(STATES)
    found = {name: state_of(after(*events)) for name, events in BEGUN.items()}
    found["between"] = state_of(after(("step.end", {"step": 1, "done": True})))
    assert found == {name: name for name in STATES}


def test_at_most_one_button_is_primary_and_those_that_lose_something_ask() -> None:
    for name, events in BEGUN.items():
        found = buttons(after(*events))
        primary = [one for one in found if one.primary]
        assert len(primary) <= 1, name
        assert all(not one.why and not one.danger for one in primary)
        for one in found:
            assert bool(one.asks) == one.danger
            assert one.order in set(Order)
    by_state = {
        name: next((one.ident for one in buttons(after(*events)) if one.primary), "")
        for name, events in BEGUN.items()
    }
    assert by_state["waiting"] == by_state["paused"] == by_state["decision"] == "order-start"
    assert by_state["judgement"] == "order-start"
    assert by_state["running"] == by_state["break"] == "order-pause"
    assert by_state["ended"] == ""


def test_the_lamp_names_what_is_lost_until_it_is_back() -> None:
    lost = BEGUN["fault"]
    lamp = lamp_of(after(*lost), Punctual(), EXPECTED)
    assert lamp.level == "bad"
    assert lamp.reason == "the controls failed: gone"
    assert "cable" in lamp.remedy
    back = (*lost, ("input.back", {}), ("pause.end", {"by": "input"}))
    assert lamp_of(after(*back), Punctual(), EXPECTED) == Lamp("ok", "all is well")


def test_what_a_session_sends_and_cannot_be_drawn_is_said_and_the_next_one_is_drawn_again() -> None:
    shapes = ShownShapes({})
    taken, situated = [], []
    shapes.take = taken.append
    shapes.situate = situated.append
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(shown, "read_run", lambda text: text)
        patched.setattr(shown, "situation_of", lambda said: said)
        scene = shapes.hear(json.dumps({"scene": 1, "situation": 2}), "")
        assert (taken, situated, shapes.trouble) == (["1"], [2], "")
        for bad in ("{", "[]", json.dumps({"scene": 3})):
            assert shapes.hear(bad, scene) == scene
            said = shapes.trouble
            assert said
            lamp = lamp_of(after(*BEGUN["running"]), Punctual(), EXPECTED, said)
            assert lamp.level == "warn"
            assert said in lamp.reason
        assert shapes.hear(json.dumps({"scene": 4, "situation": 5}), scene) == "4"
    assert (taken[-1], situated[-1], shapes.trouble) == ("4", 5, "")


def test_frames_without_their_columns_are_said_and_the_next_ones_are_taken_up() -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Live, "_pull", lambda self: None)
        live = Live("nobody")
    live.hear([(1.0, 2.0)])
    assert live.trouble.startswith("ValueError")
    live.units = {"due": "s", "woke": "s"}
    live.hear([(1.0, 1.002)])
    assert (live.trouble, live.newest["woke"]) == ("", 1.002)


def test_a_picture_that_cannot_be_read_is_said_in_its_place_and_the_next_one_is_shown() -> None:
    pictures = Pictures("nobody", {})
    for text in ("{", "[]", '{"camera": "a"}'):
        pictures.hear("operator", text, 0.0)
        assert pictures.of("operator", "a")[1].startswith("a picture cannot be read: ")
    now = pylsl.local_clock()
    good = {"camera": "a", "png": "AA", "legend": "m", "due": now}
    pictures.hear("operator", json.dumps(good), now)
    shot, said = pictures.of("operator", "a")
    assert (shot.source, said) == ("data:image/png;base64,AA", "0.0 s old · m")


def test_the_lamp_names_every_trigger_that_is_lost() -> None:
    lost = [
        *BEGUN["running"],
        *(("trigger.lost", {"trigger": name, "why": f"{name}: pulled out"}) for name in ("a", "b")),
    ]
    lamp = lamp_of(after(*lost), Punctual(), EXPECTED)
    assert (lamp.level, lamp.reason) == ("bad", "trigger failed: a: pulled out (and 1 more)")
    assert "plug the device in" in lamp.remedy
    lost.append(("trigger.back", {"trigger": "a"}))
    assert lamp_of(after(*lost), Punctual(), EXPECTED).reason == "trigger failed: b: pulled out"
    lost.append(("trigger.back", {"trigger": "b"}))
    assert lamp_of(after(*lost), Punctual(), EXPECTED).level == "ok"
    assert sentence(Event(*lost[1][:1], 0.0, lost[1][1]), str).text == "Trigger a: pulled out"


def test_the_lamp_tells_a_late_loop_and_one_that_says_nothing() -> None:
    live = Punctual()
    live.lateness_s = 0.05
    lamp = lamp_of(after(*BEGUN["running"]), live, EXPECTED)
    assert (lamp.level, "50 ms late" in lamp.reason) == ("warn", True)
    live.silent_s = 3.2
    lamp = lamp_of(after(*BEGUN["running"]), live, EXPECTED)
    assert (lamp.level, lamp.reason) == ("bad", "no frame from the session for 3 s")


def test_the_lamp_tells_of_a_trial_of_which_no_frame_came(monkeypatch: pytest.MonkeyPatch) -> None:
    live, view = Punctual(), after(("trial.start", TRIAL))
    live.silent_s = live.lateness_s = None
    for now, level in ((1.9, "ok"), (2.1, "bad")):
        monkeypatch.setattr(time, "perf_counter", lambda now=now: now)
        assert lamp_of(view, live, EXPECTED).level == level
    assert lamp_of(view, live, EXPECTED).reason == "no frame from the session for 2 s"


@pytest.mark.parametrize(
    ("rate_hz", "silent_s", "said"),
    [
        (25.0, 0.1, ""),
        (2.0, 0.4, "shows 2.0 pictures a second, and 15 are needed"),
        (25.0, 4.0, "has shown no picture for 4 s"),
        (None, None, "has shown no picture yet"),
    ],
)
def test_the_lamp_tells_of_a_view_of_the_operator_that_shows_too_little(
    rate_hz: float | None, silent_s: float | None, said: str
) -> None:
    view = after(*BEGUN["running"])
    as_told = {
        "label": "operator", "condition": "flows", "required": False, "warnings": [],
        "signals": [], "rate_hz": rate_hz, "silent_s": silent_s,
        "source_id": "labcrane/study/P001/ses-01/labcrane.feedback.operator",
    }  # fmt: skip
    view.hear_of_streams({"streams": [as_told]})
    lamp = lamp_of(view, Punctual(), EXPECTED)
    assert (lamp.level, lamp.reason) == (
        ("bad", f"the operator's view operator {said}") if said else ("ok", "all is well")
    )
    assert lamp_of(view, Punctual(), ExpectedSession(1 / 240)).level == "ok", (
        "a view of somebody else"
    )
    view.take(Event("trial.end", 9.0, {**TRIAL, "practice": False, "outcome": "success"}))
    assert lamp_of(view, Punctual(), EXPECTED).level == "ok", "between movements"


def test_a_required_stream_that_is_silent_outweighs_the_warning_of_another() -> None:
    view = after(*BEGUN["running"])
    quiet = {"warnings": [], "signals": [], "rate_hz": None}
    view.hear_of_streams({"streams": [
        {**quiet, "label": "gaze", "condition": "flows", "required": True, "warnings": ["is slow"]},
        {**quiet, "label": "eeg", "condition": "silent", "required": True},
    ]})  # fmt: skip
    assert lamp_of(view, Punctual(), EXPECTED).reason == "stream eeg is silent"
    view.streams["streams"][1]["required"] = False
    assert lamp_of(view, Punctual(), EXPECTED).reason == "stream gaze is slow"


def test_a_stream_that_is_asked_about_has_a_button_for_each_answer() -> None:
    fits = [
        {"identity": ["amp-1", "ActiChamp", "EEG"], "host": "lab-pc"},
        {"identity": ["amp-1", "Filtered", "EEG"], "host": "lab-pc"},
        {"identity": ["amp-2", "LiveAmp", "EEG"], "host": "next-door"},
    ]
    asked = {
        "label": "eeg", "condition": "asked about", "required": True, "candidates": fits,
        "warnings": ["is asked for"], "signals": [],
    }  # fmt: skip
    given = [(one.order, one.text, one.label) for one in answers(asked)]
    assert given == [
        (Order.TAKE, "eeg=ActiChamp", "Use ActiChamp on lab-pc"),
        (Order.TAKE, "eeg=Filtered", "Use Filtered on lab-pc"),
        (Order.TAKE, "eeg=amp-2", "Use LiveAmp on next-door"),
    ]
    for (_, text, _), fit in zip(given, fits, strict=True):
        assert answered(text, [asked]) == ("eeg", tuple(fit["identity"]))
    assert answers(asked | {"required": False})[-1].text == "eeg=none"
    assert answers(asked | {"candidates": []}) == []
    view = after()
    view.hear_of_streams({"streams": [asked]})
    lamp = lamp_of(view, Punctual(), EXPECTED)
    assert (lamp.level, lamp.reason) == ("warn", "stream eeg is asked for")
    assert lamp.remedy == "choose with the buttons next to it"


def test_the_lamp_at_the_end_is_what_was_left_behind() -> None:
    view = after(*BEGUN["ended"])
    assert lamp_of(view, Punctual(), EXPECTED).reason == "the session is being saved"
    view.ended = SessionLeft(
        "warn", "The session is saved but incomplete; remaining: trial 3", "to continue, run: x"
    )
    assert lamp_of(view, Punctual(), EXPECTED) == Lamp(
        "warn", "The session is saved but incomplete; remaining: trial 3", "to continue, run: x"
    )


def test_every_key_of_readme_is_on_the_page() -> None:
    """README names the keys of the terminal, and says that the page does all of it too."""
    said = README.read_text().split("While a session runs,")[1].split("does all of it too")[0]
    named = set(re.findall(r"`([a-z])`", said)) | ({" "} if "space bar" in said else set())
    assert named == {*TERMINAL_KEYS, "q"}
    page = [*(one.key for one in buttons(SessionView())), *(key for key, _ in KEYS)]
    assert len(page) == len(set(page))
    assert named <= {" " if key == "Space" else key.lower() for key in page}


class Chosen:
    def __init__(self, settings: object) -> None:
        self.settings = settings


@pytest.mark.parametrize("settings", [SphereSettings(), SonificationSettings()])
def test_whatever_a_slider_can_say_the_session_takes_or_refuses_in_words(settings: object) -> None:
    live = FeedbackSettings({"it": Chosen(settings)})
    draw = random.Random(23)
    controls = sliders("it", settings, {})
    assert len(controls) >= 5
    taken = 0
    for control in controls:
        if control["kind"] == "choice":
            values = control["choices"]
        else:
            assert control["low"] <= control["now"] <= control["high"], control
            steps = round((control["high"] - control["low"]) / control["step"])
            some = [draw.randint(0, steps) for _ in range(8)]
            values = [f"{control['low'] + control['step'] * at:.6g}" for at in some]
        for value in values:
            request = read_request(Command(Order.SETTING, f"{control['place']}={value}"))
            assert isinstance(request, SettingChange)
            why = live.refusal(request)
            taken += why is None
            assert why is None or control["key"].replace(" ", "_") in why
    assert taken > 20


def test_an_opacity_is_a_slider_to_its_bounds_unless_it_follows_an_estimate() -> None:
    (opacity,) = (one for one in sliders("b", SphereSettings(), {}) if one["key"] == "opacity")
    assert (opacity["low"] > 0.0, opacity["high"]) == (True, 1.0)
    law = {"estimate": "load.ratio", "between": [1, 3], "to": [0.2, 0.8], "at_most_per_s": 0.4}
    settings = SphereSettings(opacity=law)
    assert not [one for one in sliders("b", settings, {}) if one["key"] == "opacity"]
    why = FeedbackSettings({"b": Chosen(settings)}).refusal(SettingChange("b", "opacity", "0.5"))
    assert why == "b.opacity follows an estimate, and cannot be set by hand"


def test_a_slider_stands_at_what_was_changed_and_knows_what_the_protocol_says() -> None:
    (far,) = (one for one in sliders("b", SphereSettings(), {"far": 3.0}) if one["key"] == "far")
    assert (far["now"], far["protocol"], far["unit"]) == (3.0, 4.0, "m")


def test_events_are_sentences_with_the_names_of_trials_and_without_holes() -> None:
    def called(number: int) -> str:
        return f"trial {number - 1} of 9"

    for name, kind in KINDS.items():
        data = {**dict.fromkeys(re.findall(r"{(\w+)}", kind.sentence), "x"), "trial": 1}
        said = sentence(Event(name, 0.0, data), called)
        assert said.kind in FILTERS
        assert "?" not in said.text
        assert said.text[0].isupper()
    targets = sentence(Event("target.entered", 0.0, {"trial": 4}), called)
    assert targets.text == "Target entered: trial 3 of 9"
    refused = Event(
        "order.start", 0.0, {"by": "supervisor", "refused": "nothing is waiting to start"}
    )
    assert sentence(refused, called).text == "Start was refused: nothing is waiting to start"
    assert sentence(refused, called).level == "warn"


def test_a_bar_reaches_from_zero_to_the_value_between_the_limits() -> None:
    machine = ch8()
    draw = random.Random(7)
    for joint in machine.joints:
        low, high = joint.limits
        angle = draw.uniform(low, high)
        newest = {f"state.joint.angle.{joint.name}": angle}
        ((bar,),) = (
            group["bars"]
            for group in groups(newest, {}, machine.joints, set())
            if group["title"] == "Joints"
        )
        ends = bar["from"], bar["from"] + bar["width"]
        at = 100 * (angle - low) / (high - low)
        zero = 100 * (0 - low) / (high - low)
        assert sorted((at, zero)) == pytest.approx(sorted(ends), abs=0.11)
    sticks = groups({"axes.left.x": 0.5, "axes.left.y": 0.0}, {}, machine.joints, {"axes.left.x"})[
        0
    ]
    assert [bar["name"] for bar in sticks["bars"]] == ["left.x"]
    assert sticks["none"] == "at rest: left.y"


def test_a_cohort_of_few_is_not_shown() -> None:
    earlier = Earlier(others={"error": [0.1] * (FEWEST - 1)})
    assert earlier.cohort("error") is None
    earlier.others["error"] = [4.0, 1.0, 3.0, 2.0, 5.0]
    assert earlier.cohort("error") == (2.0, 3.0, 4.0, 5)
    assert earlier.cohort("nothing") is None


@pytest.mark.slow
def test_who_was_excluded_is_no_part_of_the_cohort(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.approve()
    for name in ("P001", "P002", "P003"):
        lab.run(name)
    folder = lab.places.root / "P001"

    def medians(session: int) -> Earlier:
        found = read_behind(folder, "rehearsal", session, ["movement_time"])
        for thread in threading.enumerate():
            if thread.name == "earlier":
                thread.join()
        return found

    before = medians(2)
    assert len(before.others["movement_time"]) == 2
    assert len(before.mine["movement_time"]) == 1
    exclude(lab.places, "P003", "did not follow the instructions", TODAY)
    after = medians(1)
    assert len(after.others["movement_time"]) == 1
    assert after.mine == {}, "of this session nothing is from before"


class Pages:
    """A process of pages that dies when it is told to, and can be started again."""

    def __init__(self, module: str, name: str, patience: object, take: object) -> None:
        self.exit_code, self.waiting, self.restarts = None, True, 0
        self.take = take
        self.told: list[object] = []

    def start(self, order: object) -> None:
        self.order = order

    def restart(self, order: object) -> bool:
        self.exit_code, self.restarts = None, self.restarts + 1
        return True

    def tell(self, message: object) -> None:
        self.told.append(message)

    def stop(self) -> None:
        pass


def test_pages_that_are_started_again_know_the_streams_after_the_recorder_has_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(handle, "ProcessHandle", Pages)
    restarted, status = threading.Event(), {"streams": [{"label": "eeg", "samples": 109_632}]}
    said = [status]
    pages = handle.PageHandle(
        PageConfig, lambda _: None, lambda _: restarted.set(), lambda: said.pop() if said else {}
    )
    pages._process.waiting = False
    try:
        wait_for(lambda: Streams(status) in pages._process.told)
        pages._process.exit_code = 1
        assert restarted.wait(240.0)
        pages._process.told.clear()
        wait_for(lambda: pages._process.told)
        assert pages._process.told[0] == Streams(status)
    finally:
        pages._closed.set()
        pages.close(SessionLeft("ok", "over"))


def test_a_page_that_knows_nothing_of_a_study_s_streams_does_not_say_that_there_are_none(
    tmp_path: Path,
) -> None:
    path = tmp_path / "study.yaml"
    steps = "      - block: {task: aiming}\n"
    asked = "streams: {eeg: {type: EEG, name: amp}}\n"
    for more, said in (("", "This study records no external streams."),
                       (asked, "Waiting for the study's streams: eeg.")):  # fmt: skip
        path.write_text(STUDY.format(study="streams", steps=steps) + more, encoding="utf-8")
        study = loaded(path)
        context = SimpleNamespace(
            study=study, plan=plan_session(study, "P001", 1), session=SessionView()
        )
        assert Snapshot(context, Earlier())._without_streams() == said
        context.session.hear_of_streams({"streams": [{"label": "eeg", "name": "amp"}]})
        assert Snapshot(context, Earlier())._without_streams() == ""
    view, expected = after(*BEGUN["running"]), ExpectedSession(1 / 240, streams=["eeg"])
    assert lamp_of(view, Punctual(), expected).reason == "no data on the streams eeg"
    view.hear_of_streams({"streams": []})
    assert lamp_of(view, Punctual(), expected).level == "ok"


def test_a_browser_of_pages_that_died_is_not_waited_for_at_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(handle, "ProcessHandle", Pages)
    monkeypatch.setattr(handle, "GONE_S", 0.0)
    restarted = threading.Event()
    pages = handle.PageHandle(PageConfig, lambda _: None, lambda _: restarted.set(), dict)
    try:
        pages._process.take(Opened(1))
        assert pages._open()
        pages._process.exit_code = 1
        assert restarted.wait(240.0)
        assert not pages._open()
    finally:
        pages._closed.set()
        pages.close(SessionLeft("ok", "over"))


def test_the_strip_of_steps_says_what_is_done_what_runs_and_how_long_each_takes(
    tmp_path: Path,
) -> None:
    path = tmp_path / "study.yaml"
    steps = "- instructions: lift.md\n- break: {seconds: 300}\n- block: {task: aiming}\n"
    steps = indent(steps, 6 * " ")
    (tmp_path / "lift.md").write_text("Lift it.\n")
    path.write_text(STUDY.format(study="strip", steps=steps), encoding="utf-8")
    study = loaded(path)
    plan = plan_session(study, "P001", 1)
    began, ended = ("step.start", {"step": 1, "kind": "instructions"}), ("step.end", {"step": 1})
    for events, states in (
        ((), ["", "", ""]),
        ((began,), ["now", "", ""]),
        ((began, (ended[0], {**ended[1], "done": True})), ["done", "", ""]),
        ((began, (ended[0], {**ended[1], "done": False})), ["now", "", ""]),
    ):
        context = SimpleNamespace(study=study, plan=plan, session=after(*events))
        found = Snapshot(context, Earlier())._steps()
        assert [step["state"] for step in found] == states
        assert [step["name"] for step in found] == ["instructions", "break", "aiming"]
        assert [step["time"] for step in found[:2]] == ["2 min", "5 min"]


def test_times_are_minutes_and_seconds_and_hours_where_there_are_some() -> None:
    assert [clock(each) for each in (0.9, 61, 3599.9, 3661)] == ["0:00", "1:01", "59:59", "1:01:01"]
    assert clock(-0.2) == "0:00"


def test_a_fault_is_told_with_its_time_what_is_done_and_the_buttons_that_solve_it() -> None:
    lost = {"what": "cab", "why": "no driver", "left_out": False, "attempt": 2, "attempts": 3}
    events = [
        ("waiting", {"what": "aiming"}),
        ("feedback.lost", lost),
        ("pause.start", {"by": "feedback cab"}),
    ]

    def told() -> tuple[str, str, str, list[str]]:
        view = after(*events)
        lamp = lamp_of(view, Punctual(), EXPECTED)
        (fault,) = view.faults.values()
        assert (fault.since, fault.why) == (1.0, "cab failed: no driver"), "since it failed first"
        solve = [button.ident for button in about_failed("cab", view)]
        start = next(one for one in buttons(view) if one.ident == "order-start")
        assert bool(start.why) == ("feedback cab" in view.standing.holds)
        return lamp.level, *handled(fault, view.standing), solve

    wait = "wait until it is back"
    assert told() == ("bad", "starts it again: attempt 2 of 3", wait, ["without-cab"])
    events.append(("feedback.lost", {**lost, "left_out": True, "attempt": 0}))
    both = ["again-cab", "without-cab"]
    given_up = "has given up after 3 attempts"
    ask = "start it again, go on without it, or end the session"
    assert told() == ("bad", given_up, ask, both)
    events.append(("order.again", {"text": "cab", "refused": None}))
    assert told() == ("bad", "starts it again: attempt 1 of 3", wait, ["without-cab"])
    events.append(("feedback.lost", {**lost, "left_out": True, "attempt": 0}))
    events.append(("order.without", {"text": "cab", "refused": None}))
    events.append(("pause.end", {"by": "feedback cab"}))
    later = "start it again when you can"
    assert told() == ("warn", f"{given_up}; goes on without it", later, ["again-cab"])
    events.append(("feedback.ready", {"what": "cab", "facts": ""}))
    view = after(*events)
    assert (view.faults, view.standing.failed) == ({}, {})


def test_instructions_are_on_the_page_until_the_operator_has_read_them() -> None:
    read = [
        ("step.start", {"step": 1, "kind": "instructions"}),
        ("instructions.shown", {"text": "Lift the log."}),
        ("waiting", {"what": "instructions"}),
    ]
    view = after(*read)
    start = next(one for one in buttons(view) if one.ident == "order-start")
    assert (start.label, start.primary) == ("They have read it: go on", True)
    assert view.instructions == "Lift the log."
    assert view.text == "The operator reads the instructions"
    view = after(*read, ("step.end", {"step": 1, "done": True}), ("waiting", {"what": "aiming"}))
    start = next(one for one in buttons(view) if one.ident == "order-start")
    assert (start.label, view.instructions) == ("Start: aiming", "")
    assert view.text == "ready to start: aiming"
