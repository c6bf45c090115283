"""Where a session stands: for its page as for itself, and each button does what it says."""

import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from rehearsal import NoLog
from stoppable import Count, block, idle_rig, stoppable, with_steps

from labcrane import Signal
from labcrane.analysis.scoring.settings import COUNTS, TIME
from labcrane.core import Event
from labcrane.core.clock import ManualClock
from labcrane.protocol.protocol import OnFault
from labcrane.protocol.steps import Step
from labcrane.session import loop
from labcrane.session.commands import FeedbackLost, FeedbackReady, Message, StreamBack, StreamLost
from labcrane.session.resume import Ledger
from labcrane.session.sequencer import Sequencer
from labcrane.session.standing import ENDED, EXAMINER, STOP, SessionStage, Standing, why_not
from labcrane.testing import Command, Order, Study, plan_session
from labcrane.web.control_room.buttons import buttons
from labcrane.web.control_room.condition import state_of
from labcrane.web.state import EARLIER_RULE, SessionView

TRIAL = {"trial": 4, "attempt": 1, "counted": True, "practice": False, "outcome": "success"}


class Tried(Count):
    """Tests of the indicator that last for 1 to 12 ticks."""

    results = tuple(Signal(name, "1") for name in (TIME, *COUNTS.values()))

    def begin_trial(self, trial: Any) -> None:
        super().begin_trial(trial)
        self._left *= 3


def a_study(folder: Path, draw: random.Random) -> Study:
    """Return one with steps of every kind that can be held, skipped or started, in any order."""
    study = stoppable(folder)
    study.tasks["count"] = Tried()
    faults = OnFault(stream_lost="pause", feedback_lost="pause")
    study.protocol.__dict__["on_fault"] = faults
    steps = [
        Step(kind="instructions", text="Read this."),
        Step(kind="break", seconds=2.0),
        Step(kind="questionnaire", questionnaires=("rating",)),
        Step(kind="fixation", seconds=0.5, points=((0.5, 0.5), (0.1, 0.9))),
        block("block", 2, ("other",) if draw.random() < 0.5 else (), None),
        block("reference", 1, (), None),
    ]
    draw.shuffle(steps)
    return with_steps(study, steps)


class Anybody:
    """Orders anything at any time, and keeps what the page said would come of it."""

    def __init__(
        self, view: SessionView, sequencer: Sequencer, draw: random.Random, log: NoLog
    ) -> None:
        self._view, self._sequencer, self._draw, self._log = view, sequencer, draw, log
        self._tick = 0
        self.said: list[tuple[str, str]] = []

    def knows(self) -> bool:
        """Whether the page stands as the session does: of each step it hears a tick later."""
        return self._view.standing == self._sequencer.standing

    def commands(self) -> list[Message]:
        self._tick += 1
        if self._tick > 600:  # enough of everything
            return [Command(Order.END)]
        # Faults are over sooner than they come: nothing begins during one.
        if self._draw.random() < (0.3 if self._log.trouble else 0.02):
            self._log.trouble = None if self._log.trouble else "full"
        if self._draw.random() < 0.15:
            return [self._draw.choice(
                [StreamLost("eeg"), *6 * [StreamBack("eeg"), FeedbackReady("tone")],
                 FeedbackLost("tone", "gone", left_out=self._draw.random() < 0.5)]
            )]  # fmt: skip
        if self._draw.random() < 0.5 or not self.knows():
            return []
        if self._draw.random() < 0.1:
            order = self._draw.choice([Order.AGAIN, Order.WITHOUT])
            name = self._draw.choice(["tone", "nothing"])
            why = self._view.standing.why_not_about(order, name) or ""
            self.said.append((f"order.{order}", why))
            return [Command(order, name)]
        button = self._draw.choice(
            [each for each in buttons(self._view) if each.order is not Order.END]
        )
        self.said.append((f"order.{button.order}", button.why))
        return [Command(Order(button.order), button.text)]


@pytest.mark.parametrize("seed", range(5))
def test_page_and_session_stand_alike_and_each_button_does_what_it_says(
    tmp_path: Path, seed: int
) -> None:
    draw = random.Random(seed)
    reached = set().union(*(stages_of_a_session(tmp_path, draw) for _ in range(8)))
    assert reached == set(SessionStage) - {SessionStage.STARTING, SessionStage.CONSENT}


def stages_of_a_session(folder: Path, draw: random.Random) -> set[SessionStage]:
    """Run one and return which stages the page has seen; what it says holds in all of them."""
    study = a_study(folder, draw)
    plan = plan_session(study, "P001", 1)
    ledger = Ledger(study, plan)
    ledger.take("session.start", {"awaits_judgement": True})
    rig, view, log = idle_rig(study), SessionView(), NoLog()
    stages: set[SessionStage] = set()
    awaits = ("tone", "view")[: draw.randint(0, 2)]
    heard: list[Event] = []
    with rig.opened(study, plan.seed) as run:
        sequencer = Sequencer(study, plan, rig, waits=True, awaits=awaits, ledger=ledger)

        console = Anybody(view, sequencer, draw, log)
        behind = False

        def hear(frame: Any) -> None:
            nonlocal behind
            assert frame.events or not behind, "what it did not know is told a tick later"
            for event in frame.events:
                heard.append(event)
                view.take(event)
            behind = not console.knows()
            stages.add(view.standing.stage)

        loop.run(rig, run, sequencer, ManualClock(start=1000.0), console, log, [hear])
    done = [(e.name, e.data["refused"] or "") for e in heard if e.name.startswith("order.")]
    done = [each for each in done if each[0] != "order.end"]
    first = next((at for at, each in enumerate(console.said) if "begun" not in each[1]), 0)
    assert done[first:] == console.said[first:]
    assert len(done) > 20
    assert view.standing.stage is SessionStage.ENDED
    assert all(button.why == ENDED for button in buttons(view))
    return stages


def after(*events: tuple[str, Mapping[str, Any]]) -> SessionView:
    view = SessionView()
    for name, data in events:
        view.take(Event(name, 1.0, data))
    return view


def presses(view: SessionView) -> dict[str, str]:
    return {button.ident: button.why for button in buttons(view)}


PAUSED = ("pause.start", {"by": EXAMINER})


@pytest.mark.parametrize(
    "running",
    [("break.start", {"seconds": 60.0}), ("fixation.shown", {"point": 1}),
     ("questionnaire.start", {"questionnaire": "a", "title": "A", "kept": "{}"})],
)  # fmt: skip
def test_what_is_paused_can_be_skipped_all_the_same(running: tuple[str, dict]) -> None:
    for view in (after(running, PAUSED), after(running, ("pause.start", {"by": "input"}))):
        assert presses(view)["order-skip"] == ""


def test_nothing_is_started_that_a_fault_would_hold() -> None:
    lost = (
        ("waiting", {"what": "aiming"}),
        ("input.lost", {"why": "pulled out"}),
        ("pause.start", {"by": "input"}),
    )
    view = after(*lost)
    start = next(each for each in buttons(view) if each.ident == "order-start")
    assert (start.label, start.primary) == ("Start: aiming", False)
    assert start.why == "stopped by a fault, and a movement would be held: input"
    assert state_of(view) == "fault"
    view = after(*lost, ("input.back", {}), ("pause.end", {"by": "input"}))
    assert presses(view)["order-start"] == ""


def test_a_decision_stays_open_when_a_fault_beside_it_is_over() -> None:
    met = ("stop_rule.met", {"questionnaire": "ssq", "score": "total", "value": 9, "above": 5})
    view = after(
        met, ("pause.start", {"by": STOP}), ("pause.start", {"by": "disk"}),
        ("pause.end", {"by": "disk"}),
    )  # fmt: skip
    assert state_of(view) == "decision"
    assert view.alarm == "ssq total is 9, above 5: continue or end the session"
    view.take(Event("pause.end", 2.0, {"by": STOP}))
    assert (state_of(view), view.alarm) == ("between", "")


def test_a_session_resumed_under_a_stop_rule_asks_for_the_decision_and_can_go_on() -> None:
    view = after(("session.standing", {"done": 3}), ("pause.start", {"by": STOP}))
    assert (state_of(view), view.alarm) == ("decision", EARLIER_RULE)
    assert presses(view)["order-start"] == ""


def test_a_test_of_before_a_resume_can_be_judged_at_once() -> None:
    view = after(("session.standing", {"done": 3, "trial": 4, "attempt": 1}), PAUSED)
    assert presses(view)["order-completion1"] == presses(view)["order-override"] == ""
    assert presses(view)["order-repeat"] == "no trial is running"


def test_before_a_session_begins_only_its_end_can_be_ordered() -> None:
    begun = Standing().after("session.standing", {"done": 0})
    early = {order for order in Order if why_not(order, begun) is None}
    assert early == {Order.END}
    asked = after(("consent.needed", {"file": "c.txt", "version": "a", "text": ""}))
    assert set(presses(asked).values()) == {
        "",
        "the session has not begun; order it again when it has",
    }
    awaited = after(("feedback.awaited", {"what": "tone"}))
    assert presses(awaited)["order-start"] == "the session is waiting for feedback tone"
    assert presses(awaited)["order-pause"] == ""
    assert state_of(awaited) == "starting"
