"""Contracts of what presents a session: cues and feedback."""

import copy

import numpy as np
from pydantic import BaseModel

from labcrane.core.primitives import Shape, Sphere
from labcrane.core.records import Frame, Run, SessionState
from labcrane.core.roles import Cue, Feedback
from labcrane.core.signals import Layout, Signal
from labcrane.testing.components import check_closes_after_failed_open, check_soon
from labcrane.testing.roles import (
    ch8,
    check_signals,
    crane_at,
    make_frame,
    make_run,
    make_trial,
    opened,
)

TARGETS = (
    Signal("target.position", "m", ("x", "y", "z")),
    Signal("target.radius", "m"),
    Signal("other.position", "m", ("x", "y", "z")),
)
"""What a task of aiming movements shows."""


def make_target(run: Run, number: int = 0) -> Frame:
    """Return a frame with a target in it; each number has another one."""
    machine = run.machine
    turn = 0.02 * number
    frame = make_frame(run, number, crane_at(machine, [turn, *machine.rest[1:]]))
    frame.task = np.array([5.5, 1.0 - turn, 0.8, 0.25, 4.5, -1.0, 0.8])
    return frame


def make_movement(run: Run, number: int = 0) -> Frame:
    """Return a frame with a target in which the tip moves at 0.4 m/s."""
    frame = make_target(run, number)
    frame.state[run.state.find("tip.velocity")] = (0.3, 0.2, -0.17)
    return frame


class CueContract:
    """What every cue must do. Provide the fixture ``cue``."""

    def test_cue_draws_the_same_for_the_same_frame(self, cue: Cue) -> None:
        check_signals(cue)
        run = make_run(ch8(), task=TARGETS)
        with opened(cue, run):
            seen = [make_target(run, number) for number in range(5)]
            first = [list(cue.draw(frame)) for frame in seen]
            again = [list(cue.draw(copy.deepcopy(frame))) for frame in reversed(seen)]
            assert first == again[::-1], "draw must depend on the frame alone"

    def test_cue_draws_shapes_with_names_of_their_own(self, cue: Cue) -> None:
        run = make_run(ch8(), task=TARGETS)
        with opened(cue, run):
            # Each drawing is looked at before the next: a cue may use its shapes again.
            seen = 0
            for frame in (make_target(run), make_movement(run)):
                shapes = cue.draw(frame)
                names = [shape.name for shape in shapes]
                assert len(set(names)) == len(names), f"two shapes have one name: {names}"
                for shape in shapes:
                    _check_shape(shape)
                seen += len(shapes)
            assert seen, (
                "draw() returned no shape for a frame with a target, neither with the tip at rest "
                "nor moving at 0.4 m/s"
            )

    def test_cue_has_the_numbers_its_signals_promise(self, cue: Cue) -> None:
        run = make_run(ch8(), task=TARGETS)
        with opened(cue, run):
            values = cue.values(make_target(run))
            size = Layout("cue", cue.signals).size
            assert values.shape == (size,), (
                f"values() has shape {values.shape}; signals of {size} numbers are promised"
            )
            assert np.isfinite(values).all(), f"values() must be finite with a target: {values}"

    def test_cue_draws_at_once(self, cue: Cue) -> None:
        run = make_run(ch8(), task=TARGETS)
        frame = make_target(run)
        with opened(cue, run):
            cue.begin_trial(make_trial())
            check_soon(lambda: cue.draw(frame))

    def test_cue_closes_after_a_failed_open(self, cue: Cue) -> None:
        check_closes_after_failed_open(cue)

    def test_cue_draws_nothing_between_trials(self, cue: Cue) -> None:
        run = make_run(ch8(), task=TARGETS)
        with opened(cue, run):
            shapes = cue.draw(make_frame(run))
            assert not shapes, f"draw() returned {shapes} between trials, when no target is there"


def _check_shape(shape: Shape) -> None:
    points = [shape.centre] if isinstance(shape, Sphere) else [shape.start, shape.end]
    assert np.isfinite(points).all(), f"a shape must be somewhere: {shape}"
    assert shape.radius > 0.0, f"a radius must be over 0 m: {shape}"
    fine = all(0.0 <= part <= 1.0 for part in shape.colour)
    assert fine, f"red, green, blue and alpha must be 0 to 1: {shape}"


class Foreign(BaseModel):
    """Settings of no component."""


class FeedbackContract:
    """What all feedback must do. Provide the fixture ``feedback``."""

    def test_feedback_returns_what_its_signals_promise(self, feedback: Feedback) -> None:
        check_signals(feedback)
        run = make_run(ch8(), task=TARGETS)
        with opened(feedback, run):
            size = Layout("feedback", feedback.signals).size
            feedback.update(SessionState(trial=1, trials=1))
            for number in range(3):
                values = feedback.present(make_target(run, number))
                assert values.shape == (size,), f"promised ({size},), got {values.shape}"
                assert values.dtype == np.float64, f"present() gave {values.dtype}, not float64"
                samples = feedback.samples()
                assert set(samples) == set(feedback.streams), (
                    f"samples() has {sorted(samples)}; streams are {sorted(feedback.streams)}"
                )
                for name, signals in feedback.streams.items():
                    rows = np.atleast_2d(samples[name])
                    promised = Layout(name, signals).size
                    assert rows.shape[1:] == (promised,), (
                        f"samples()[{name!r}] has rows of shape {rows.shape[1:]}, and streams "
                        f"promise ({promised},); return one row per sample"
                    )

    def test_feedback_has_pictures_of_its_cameras_only(self, feedback: Feedback) -> None:
        run = make_run(ch8(), task=TARGETS)
        with opened(feedback, run):
            feedback.present(make_target(run))
            pictures = feedback.pictures()
            assert set(pictures) <= set(feedback.cameras), (
                f"pictures() has {sorted(pictures)}; cameras are {sorted(feedback.cameras)}"
            )
            for name, picture in pictures.items():
                pixels = picture.pixels
                assert pixels.dtype == np.uint8, (
                    f"pictures()[{name!r}] has pixels of {pixels.dtype}; give them as uint8"
                )
                assert pixels.shape[2:] in {(), (3,)}, (
                    f"pictures()[{name!r}] has shape {pixels.shape}; give (height, width) for "
                    "greys, or (height, width, 3)"
                )
                assert np.isfinite(picture.due), (
                    f"pictures()[{name!r}] is of {picture.due} s; due is the time of its frame"
                )

    def test_feedback_rests_between_trials(self, feedback: Feedback) -> None:
        run = make_run(ch8(), task=TARGETS)
        with opened(feedback, run):
            feedback.update(SessionState())
            feedback.present(make_frame(run))  # a frame without a target
            feedback.idle()

    def test_feedback_adjusts_itself_to_no_settings_but_its_own(self, feedback: Feedback) -> None:
        run = make_run(ch8(), task=TARGETS)
        with opened(feedback, run):
            before = feedback.present(make_target(run)).shape
            assert feedback.adjust(Foreign()) is False, "adjust() must refuse foreign settings"
            after = feedback.present(make_target(run)).shape
            assert after == before, f"present() gave shape {before}, then {after}"

    def test_feedback_closes_without_having_been_opened(self, feedback: Feedback) -> None:
        feedback.update(SessionState(trial=1))  # before a preview, which needs nothing open
        feedback.close()

    def test_feedback_closes_after_a_failed_open(self, feedback: Feedback) -> None:
        check_closes_after_failed_open(feedback)
