"""The supervisor's view of a test: what stands while it runs is what is scored afterwards."""

import random

import pytest

from labcrane.analysis.scoring.indicator import Performance, indicate
from labcrane.analysis.scoring.settings import COUNTS, IndicatorSettings
from labcrane.core import Event
from labcrane.testing import Order
from labcrane.web.assessment import LIVE, Assessment
from labcrane.web.server.access import RIGHTS
from labcrane.web.state import SessionView

SETTINGS = IndicatorSettings()


def began(number: int, scenario: str, **more) -> Event:
    about = {"trial": number, "attempt": 1, "scenario": scenario, "practice": 0, **more}
    return Event("trial.start", 0.0, about)


def ended(start: Event, time: float, counts: dict[str, int], outcome: str = "success") -> Event:
    row = {column: float(counts.get(kind, 0)) for kind, column in COUNTS.items()}
    return Event("trial.end", 0.0, {**start.data, "time": time, **row, "outcome": outcome})


def rated(accuracy: float | None, awareness: float | None) -> list[Event]:
    names = {"subjective_accuracy": accuracy, "situational_awareness": awareness}
    return [
        Event("questionnaire.end", 0.0, {"questionnaire": name, "score.share": share})
        for name, share in names.items()
    ]


def frame(number: int, elapsed: float, counts: dict[str, int]) -> dict[str, float]:
    columns = {column: float(counts.get(kind, 0)) for kind, column in LIVE.items()}
    return {"trial": float(number), "elapsed": elapsed, **columns}


def following(*events: Event) -> Assessment:
    followed = Assessment()
    for event in events:
        followed.take(event)
    return followed


def reference(scenario: str, *times: float) -> list[Event]:
    found = []
    for number, time in enumerate(times, start=1):
        start = began(number, scenario, reference=True)
        found += [start, ended(start, time, {})]
    return found


def test_a_running_test_shows_its_time_mistakes_and_points_so_far() -> None:
    start = began(9, "touch")
    followed = following(*reference("touch", 20.0, 30.0), start)
    newest = frame(9, 50.0, {"object": 1, "overload_max": 2})
    assert followed.lines(newest, SETTINGS) == [
        "test in touch, running",
        "time: 50.0 s, reference 25.0 s: 200 %",
        "objects hit: 1 of 4",
        "body hit: 0 of 4",
        "overloads, max direction: 2 of 4",
        "overloads, min direction: 0 of 4",
        "indicator: 75.0 of 100, ratings not yet given; k 1 (if it is completed)",
    ]
    assert followed.lines(newest | {"trial": 8.0}, SETTINGS) == []  # the frame of another trial
    assert followed.lines({"trial": 9.0, "elapsed": 1.0}, SETTINGS) == []  # a task that counts none


@pytest.mark.parametrize("seed", range(20))
def test_an_ended_test_shows_the_indicator_that_it_is_scored_with(seed: int) -> None:
    dice = random.Random(seed)
    counts = {kind: dice.randint(0, 5) for kind in COUNTS}
    time, t_ref = dice.uniform(5.0, 90.0), dice.uniform(5.0, 90.0)
    shares = dice.randint(0, 10) / 10, dice.randint(0, 10) / 10
    start = began(3, "carry")
    events = [*reference("carry", t_ref), *reference("touch", 1.0), start]
    events += [ended(start, time, counts), *rated(*shares)]
    completed = max(counts.values()) <= SETTINGS.mistakes
    test = Performance(time, **counts, accuracy=shares[0], awareness=shares[1], completed=completed)
    found = indicate(test, t_ref, SETTINGS)
    last = following(*events).lines({}, SETTINGS)[-1]
    assert last.startswith(f"indicator: {found.raw:.1f}, {found.percent:.1f} %; k {int(completed)}")


def test_what_the_supervisor_decides_counts_until_the_next_test_begins() -> None:
    start, after = began(3, "carry"), {"after": True, "trial": 3}
    many = ended(start, 20.0, {"body": 5}, "failure")
    events = [*reference("carry", 20.0), start, many, *rated(1.0, 1.0)]
    followed = following(*events)
    assert followed.lines({}, SETTINGS)[-1] == (
        "indicator: 0.0, 0.0 %; k 0 (more than 4 mistakes of one kind)"
    )
    followed.take(Event("order.override", 0.0, {**after, "refused": "none is running"}))
    assert "k 0" in followed.lines({}, SETTINGS)[-1]
    followed.take(Event("order.override", 0.0, {**after, "text": "", "refused": None}))
    said = "indicator: 100.0, 83.3 %; k 1 (overridden by the experimenter after its end)"
    assert followed.lines({}, SETTINGS)[-1] == said
    followed.take(Event("order.completion", 0.0, {**after, "text": "0", "refused": None}))
    assert (
        followed.lines({}, SETTINGS)[-1] == "indicator: 0.0, 0.0 %; k 0 (set by the experimenter)"
    )
    followed.take(began(4, "carry"))
    (*_, last) = followed.lines(frame(4, 1.0, {}), SETTINGS)
    assert last.endswith("k 1 (if it is completed)")


def test_drops_are_shown_beside_the_indicator_and_do_not_touch_the_completion_factor() -> None:
    start = began(9, "carry")
    followed = following(*reference("carry", 20.0), start)
    lines = followed.lines(frame(9, 20.0, {}) | {"task.mistakes.drop": 2.0}, SETTINGS)
    assert "drops: 2, outside the indicator" in lines
    assert lines[-1].endswith("k 1 (if it is completed)")
    followed.take(Event("trial.end", 0.0, ended(start, 20.0, {}).data | {"n_drop": 5.0}))
    *_, drops, last = followed.lines({}, SETTINGS)
    assert drops == "drops: 5, outside the indicator"
    assert last.endswith("k 1 (the task was done)")


def test_practice_and_tests_without_a_reference_have_no_indicator() -> None:
    followed = following(*reference("carry", 20.0), began(7, "touch"))
    lines = followed.lines(frame(7, 4.0, {}), SETTINGS)
    assert lines[1] == "time: 4.0 s, no reference yet"
    assert lines[-1] == "no indicator: this scenario has no reference time"
    followed.take(began(8, "carry", practice=1))
    assert followed.lines(frame(8, 4.0, {}), SETTINGS)[-1] == "no indicator: this is not a test"
    start = began(9, "carry")
    followed.take(start)
    followed.take(ended(start, 25.0, {}))
    for event in rated(None, 0.5):  # one that was declined
        followed.take(event)
    assert "ratings not yet given" in followed.lines({}, SETTINGS)[-1]
    followed.take(Event("trial.end", 0.0, {"trial": 10, "outcome": "success"}))  # another task's
    assert followed.lines({}, SETTINGS) == []


def test_what_was_reported_as_seen_is_shown_until_the_next_trial_begins() -> None:
    session = SessionView()
    about = {"by": "participant", "text": "deformity"}
    session.take(Event("trial.start", 0.0, {"trial": 1, "attempt": 1}))
    session.take(Event("order.report", 1.0, {**about, "text": "fire", "refused": "no task asks"}))
    assert session.reported == []
    session.take(Event("order.report", 2.0, {**about, "refused": None}))
    assert session.reported == ["deformity"]
    session.take(Event("trial.start", 3.0, {"trial": 2, "attempt": 1}))
    assert session.reported == []


def test_participants_may_report_what_is_seen_and_still_lead_nothing() -> None:
    assert RIGHTS["participant"] == {Order.ANSWER, Order.SUBMIT, Order.CONSENT, Order.REPORT}
