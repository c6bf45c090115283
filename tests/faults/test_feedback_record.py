"""What was seen and heard can be computed again from the file, also when settings were changed."""

import numpy as np
import pandas as pd
import pytest
from faults.jack_session import Examiner, a_jack_session
from faults.sessions import unique
from simple_crane import FORM

import labcrane as lab
from labcrane.core import Event
from labcrane.testing import Command, Order

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study whose examiner changes settings
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 20, limit_s: 1.2}}
feedback:
  ball: {{use: sphere, far: 4.0}}
  tone: {{use: sonification, driver: jack, block: 1024, far: 4.0, aside: 2.0, silent_after_s: null,
    weighting: none}}
views:
  window: {{use: view, display: hidden, renderer: software, size: [160, 90], rate_hz: 30}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming}}
"""
)

CHANGES = ("tone.far=2.5", "ball.far=2.5", "tone.pan=away", "tone.fat=1")
"""Given in the middle of the session; the last one is refused."""

SETTLED_S = 0.5
"""A change is in the next picture and the next tone, on however busy a computer."""


class Changing(Examiner):
    """Changes settings when all have presented something, and ends soon after."""

    def __init__(self) -> None:
        super().__init__()
        self.begun = 0

    def all_have_presented(self) -> bool:
        return min(handle.presented for handle in self.launcher._feedback.handles) > 60

    def report(self, event: Event) -> None:
        super().report(event)
        if event.name != "trial.start" or not (self.begun or self.all_have_presented()):
            return
        if not self.begun:
            for change in CHANGES:
                self.give(Command(Order.SETTING, change))
        elif self.begun == 3:
            self.give(Command(Order.END))
        self.begun += 1


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> lab.recording.SessionRecord:
    folder = tmp_path_factory.mktemp("settings")
    played, _ = a_jack_session(STUDY.format(study=unique("settings")), folder, Changing())
    return played


def distances(session: lab.recording.SessionRecord, tick: np.ndarray) -> np.ndarray:
    """Return the way from tip to target at recorded ticks, shape ``(n, 3)``."""
    state, task = session.streams["state"].data, session.streams["task"].data
    tip, target = (
        data[[f"{name}.position.{axis}" for axis in "xyz"]].to_numpy()[tick]
        for data, name in ((state, "tip"), (task, "target"))
    )
    return target - tip


def before_and_after(
    session: lab.recording.SessionRecord, shown: pd.DataFrame
) -> tuple[np.ndarray, ...]:
    """Return which rows were presented before the settings were changed, and which well after."""
    changed = session.events.query("name == 'feedback.setting'")["time"]  # within a tick or two
    due = shown["frame.due"].to_numpy()
    return due < changed.min(), due > changed.max() + SETTLED_S


@pytest.mark.slow
def test_every_change_of_a_setting_is_an_event(session: lab.recording.SessionRecord) -> None:
    events = session.events
    made = [dict(data) for data in events.loc[events["name"] == "feedback.setting", "data"]]
    assert [{key: data[key] for key in ("feedback", "key", "value")} for data in made] == [
        {"feedback": "tone", "key": "far", "value": 2.5},
        {"feedback": "ball", "key": "far", "value": 2.5},
        {"feedback": "tone", "key": "pan", "value": "away"},
    ]
    asked = list(events.loc[events["name"] == "order.setting", "data"])
    assert [data["refused"] is None for data in asked] == [True, True, True, False]


@pytest.mark.slow
def test_the_tone_is_rebuilt_from_the_record(session: lab.recording.SessionRecord) -> None:
    heard = session.streams["labcrane.feedback.tone"].data
    way = distances(session, heard["frame.tick"].to_numpy(int))
    there = np.isfinite(way[:, 0])
    settings = session.context["components"]["feedback.tone"]["settings"]
    (low, high), (quiet, loud) = settings["pitch_hz"], settings["level"]
    for rows, far, side in zip(
        before_and_after(session, heard), (4.0, 2.5), (-1.0, 1.0), strict=True
    ):
        chosen = rows & there
        assert chosen.sum() > 50
        near = 1.0 - np.minimum(np.linalg.norm(way[chosen], axis=1) / far, 1.0)
        expected = {
            "pitch": low * (high / low) ** near,
            "level": quiet + (loud - quiet) * near,
            "pan": np.clip(side * way[chosen, 1] / 2.0, -1.0, 1.0),
        }
        for name, values in expected.items():
            np.testing.assert_allclose(heard[f"tone.{name}"].to_numpy()[chosen], values, rtol=1e-9)


@pytest.mark.slow
def test_the_sphere_follows_a_changed_setting_in_every_view(
    session: lab.recording.SessionRecord,
) -> None:
    shown = session.streams["labcrane.feedback.window"].data
    way = distances(session, shown["frame.tick"].to_numpy(int))
    radius = shown["cue.ball.radius"].to_numpy()
    for rows, far in zip(before_and_after(session, shown), (4.0, 2.5), strict=True):
        chosen = rows & np.isfinite(radius)
        assert chosen.sum() > 20
        away = np.minimum(np.linalg.norm(way[chosen], axis=1) / far, 1.0)
        np.testing.assert_allclose(radius[chosen], 0.15 + 0.45 * away, rtol=1e-9)
