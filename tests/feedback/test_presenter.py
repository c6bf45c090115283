"""What a presenter shows and sounds: while it is switched on, and as it is set."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import labcrane
from labcrane import Feedback, Settings, Signal, offer
from labcrane.core import Cylinder, SessionState, Sphere
from labcrane.feedback.config import ComponentConfig, FeedbackConfig
from labcrane.feedback.presenter import Presenter
from labcrane.testing import TARGETS, ch8, discover, make_run, make_target


class Plain(Settings):
    """No settings."""

    gain: float = 1.0
    """Multiplies what is presented."""


class Notebook(Feedback):
    """Writes down what it is given."""

    signals = (Signal("gained", "1"),)
    rested = 0

    def __init__(self, settings: Plain) -> None:
        self.gain = settings.gain
        self.shapes: list[Sphere | Cylinder] = []

    def present(self, frame: labcrane.Frame) -> labcrane.FloatArray:
        self.shapes = list(frame.shapes)
        return np.array([self.gain])

    def idle(self) -> None:
        self.rested += 1


def presenter(*, always: bool) -> Presenter:
    registry = discover()
    book = offer("notebook", Plain, lambda settings, machine: Notebook(settings))
    registry.offers[Feedback]["notebook"] = book
    order = FeedbackConfig(
        "book",
        ComponentConfig("notebook", {}),
        make_run(ch8(), task=TARGETS),
        "test",
        Path("study.yaml"),
        always=always,
        cues={"ball": ComponentConfig("sphere", {"at": "tip"})},
    )
    again = FeedbackConfig.from_json(order.as_json())
    assert json.loads(again.as_json()) == json.loads(order.as_json())
    made = Presenter(again, registry)
    made.open()
    return made


def test_a_cue_is_drawn_only_while_it_is_switched_on() -> None:
    made = presenter(always=True)
    frame = make_target(make_run(ch8(), task=TARGETS))
    off = made.present(frame)
    assert off is not None
    assert not made.feedback.shapes
    assert np.isnan(off[1:]).all()
    made.update(SessionState(trial=1, active=("ball",)))
    on = made.present(frame)
    assert [shape.name for shape in made.feedback.shapes] == ["sphere"]
    assert on is not None
    assert made.layout.columns[1:] == tuple(
        f"cue.ball.{name}" for name in ("distance", "radius", "brightness")
    )
    assert np.isfinite(on).all()


def test_a_sound_rests_once_when_it_is_switched_off() -> None:
    made = presenter(always=False)
    frame = make_target(make_run(ch8(), task=TARGETS))
    assert made.present(frame) is None
    made.update(SessionState(trial=1, active=("book",)))
    assert made.present(frame) is not None
    made.update(SessionState())
    for _ in range(3):
        assert made.present(frame) is None
    assert made.feedback.rested == 1


def test_a_changed_setting_takes_effect() -> None:
    made = presenter(always=True)
    frame = make_target(make_run(ch8(), task=TARGETS))
    tip = SessionState(trial=1, active=("ball",))
    made.update(tip)
    made.present(frame)
    np.testing.assert_array_equal(made.feedback.shapes[0].centre, frame.state[8:11])
    made.update(replace(tip, settings={"ball": {"at": "target"}, "book": {"gain": 3.0}}))
    values = made.present(frame)
    assert values is not None
    assert values[0] == 3.0
    np.testing.assert_array_equal(made.feedback.shapes[0].centre, frame.task[:3])
