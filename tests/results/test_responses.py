"""Responses of a detection response task, timed by the record of the view or sound."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis import measures_by, responses

RATE_HZ = 240.0


class Log(SimpleNamespace):
    """A stream of what was presented."""

    def column(self, name: str) -> np.ndarray:
        return self.units[name]


def a_log(late_s: float, ticks: range, behind: int | None = None) -> Log:
    tick = np.array(ticks, float)
    units = {"frame.tick": tick, "frame.due": tick / RATE_HZ}
    if behind is not None:
        units["shown.tick"] = tick - behind
    return Log(time=tick / RATE_HZ + late_s, units=units)


def a_session(
    stimuli: dict[float, float | None], logs: dict[str, Log], held: tuple[float, ...] = ()
) -> Any:
    """Return a session with stimuli and the response to each, in seconds."""
    rows: list[tuple[str, float, dict[str, Any]]] = [
        ("trial.start", 0.0, {"trial": 1, "attempt": 1, "block": 1, "practice": False})
    ]
    rows[0][2]["feedback"] = "drt+light+beep"
    rows.append(("feedback.ready", 0.0, {"what": "screen"}))
    for number, (sent, responded) in enumerate(stimuli.items(), start=1):
        about = {"secondary": "drt", "stimulus": number}
        rows.append(("drt.stimulus", sent, about))
        if responded is not None:
            rows.append(("drt.response", responded, about))
        outcome = "held" if sent in held else "hit"  # what the session could say then
        rows.append(("drt.outcome", sent + 2.6, {**about, "outcome": outcome}))
    rows.append(("trial.end", 99.0, {**rows[0][2], "counted": True, "outcome": "success"}))
    settings = {"hit_s": (0.1, 2.5), "longest_s": 1.0}
    presenter = {"settings": {"stimulus": "drt.stimulus"}}
    components = {
        "secondary.drt": {"settings": settings},
        "feedback.light": presenter,
        "feedback.beep": presenter,
        "views.screen": {"settings": {}},
    }
    return SimpleNamespace(
        attrs={"rate_hz": RATE_HZ},
        context={"components": components},
        events=pd.DataFrame(rows, columns=["name", "time", "data"]),
        streams={f"labcrane.feedback.{name}": log for name, log in logs.items()},
    )


def test_a_response_time_counts_from_the_picture_with_the_stimulus() -> None:
    # A picture every fourth tick, on the screen 30 ms after its frame.
    log = {"screen": a_log(0.03, range(0, 3000, 4), behind=0)}
    session = a_session({1.0: 1.5, 5.0: 5.12, 9.0: None}, log)
    found = responses(session)
    np.testing.assert_allclose(found["shown"], [1.03, 5.03, 9.03])
    np.testing.assert_allclose(found["response_time"], [0.47, 0.09, np.nan])
    assert found["outcome"].tolist() == ["hit", "cheat", "miss"]
    assert responses(session, display_delay_s=0.02)["response_time"][0] == pytest.approx(0.45)


def test_a_view_with_a_delay_shows_the_stimulus_later() -> None:
    found = responses(a_session({1.0: 1.5}, {"screen": a_log(0.01, range(3000), behind=24)}))
    assert found["shown"][0] == pytest.approx(1.0 + 0.1 + 0.01)


def test_of_two_presentations_the_first_counts() -> None:
    logs = {"screen": a_log(0.03, range(3000)), "beep": a_log(0.005, range(3000))}
    assert responses(a_session({1.0: 1.5}, logs))["shown"][0] == pytest.approx(1.005)


def test_a_stimulus_that_was_not_presented_or_was_held_does_not_count() -> None:
    log = {"screen": a_log(0.0, range(1000))}  # fails after four seconds
    found = responses(a_session({1.0: 1.5, 3.9: 3.95, 8.0: None}, log, held=(3.9,)))
    assert found["outcome"].tolist() == ["hit", "held", "not shown"]
    (row,) = measures_by(found, ["block"]).to_dict("records")
    assert (row["n"], row["hits"], row["misses"], row["held"]) == (3, 1, 0, 2)


def test_a_late_picture_can_turn_a_miss_into_a_hit() -> None:
    found = responses(a_session({1.0: 3.52}, {"screen": a_log(0.1, range(3000))}))
    assert found["outcome"].tolist() == ["hit"]
    assert found["response_time"][0] == pytest.approx(2.42)


def test_a_sound_that_never_started_is_not_replaced_by_pictures() -> None:
    session = a_session({1.0: 1.5}, {"screen": a_log(0.0, range(3000))})
    del session.context["components"]["feedback.light"]
    lost = pd.DataFrame([("feedback.lost", 0.0, {"what": "beep"})], columns=session.events.columns)
    session.events = pd.concat([lost, session.events], ignore_index=True)
    assert responses(session)["outcome"].tolist() == ["not shown"]


def test_only_trials_that_count_are_measured() -> None:
    session = a_session({1.0: 1.5}, {"screen": a_log(0.0, range(3000))})
    assert measures_by(responses(session), ["block"])["hits"].tolist() == [1]
    session.events.loc[session.events["name"] == "trial.end", "data"] = [
        {"trial": 1, "attempt": 1, "counted": True, "outcome": "repeated"}
    ]
    assert responses(session)["counted"].tolist() == [0.0]
    assert measures_by(responses(session), ["block"]).empty
