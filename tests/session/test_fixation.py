"""Check of the eye tracker in a session: what is shown when, a pause, a skip, a stop."""

from pathlib import Path

import pytest
from rehearsal import SHORT, a_study, rehearse

from labcrane import ProtocolError
from labcrane.core import Event, SessionState
from labcrane.streams.context import situation_after
from labcrane.testing import Command, Order

RATE_HZ = 240
WITH_POINTS = SHORT.replace(
    "- block:",
    "- fixation: {seconds: 1.5, points: [[0.5, 0.5], [0.1, 0.2], [0.9, 0.8]]}\n      - block:",
)


def ticks(events: list[Event]) -> list[int]:
    """Return in which tick each happened; the clock of a rehearsal does not wait."""
    first = events[0].time
    return [round((event.time - first) * RATE_HZ) for event in events]


def test_each_point_is_shown_for_its_time_and_then_the_next(tmp_path: Path) -> None:
    seen = rehearse(a_study(tmp_path, WITH_POINTS))
    shown, over = seen.events("fixation.shown"), seen.events("fixation.over")
    assert [(each.data["x"], each.data["y"]) for each in shown] == [
        (0.5, 0.5),
        (0.1, 0.2),
        (0.9, 0.8),
    ]
    assert ticks(shown) == [0, 360, 720]
    assert [each.data["done"] for each in over] == [True] * 3
    assert ticks([shown[0], *over])[1:] == [360, 720, 1080]
    assert seen.events("step.end")[0].data["done"]


def test_a_pause_begins_the_point_again_and_the_part_before_it_is_not_done(tmp_path: Path) -> None:
    orders = {400: [Command(Order.PAUSE, "")], 500: [Command(Order.START, "")]}
    seen = rehearse(a_study(tmp_path, WITH_POINTS), orders)
    told = [(e.data["point"], e.data.get("done")) for e in seen.events("fixation.over")]
    assert told == [(1, True), (2, False), (2, True), (3, True)]
    shown = seen.events("fixation.shown")
    assert [each.data["point"] for each in shown] == [1, 2, 2, 3]
    assert ticks(shown)[3] - ticks(shown)[2] == 360


@pytest.mark.parametrize(("order", "done"), [(Order.SKIP, True), (Order.END, False)])
def test_a_check_that_is_skipped_or_ended_says_which_point_was_not_done(
    tmp_path: Path, order: Order, done: object
) -> None:
    """What was skipped is not asked for again; what the session's end cut off is."""
    seen = rehearse(a_study(tmp_path, WITH_POINTS), {100: [Command(order, "")]})
    assert [each.data for each in seen.events("fixation.over")] == [{"point": 1, "done": False}]
    first = seen.events("step.end")[0]
    assert (first.data["kind"], first.data["done"]) == ("fixation", done)


def test_who_presents_knows_the_point_as_long_as_it_is_shown() -> None:
    state = SessionState(waiting="fixation")
    shown = Event("fixation.shown", 1.0, {"point": 1, "x": 0.25, "y": 0.75})
    state = situation_after(state, shown)
    assert (state.fixation, state.waiting) == ((0.25, 0.75), "")
    state = situation_after(state, Event("fixation.over", 2.0, {"point": 1, "done": True}))
    assert state.fixation == ()


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("{seconds: 0.5}", "seconds"),
        ("{points: []}", "points"),
        ("{points: [[0.5, 1.5]]}", "points"),
        ("{point: [[0.5, 0.5]]}", "points"),
        ("true", "fixation"),
    ],
)
def test_a_check_that_cannot_be_is_refused_with_its_key(
    tmp_path: Path, written: str, said: str
) -> None:
    text = SHORT.replace("- block:", f"- fixation: {written}\n      - block:")
    with pytest.raises(ProtocolError, match=rf"study\.yaml:.*{said}"):
        a_study(tmp_path, text)
