"""A spatial n-back task during the movements: balls appear at changing places.

The operator presses a button when the place is the same as ``back`` balls ago. The cue
``nback_ball`` draws the ball in every view. The feedback ``nback`` sends LSL markers and records
each ball and each press. The places depend only on settings, trial and time, so that cue and
feedback agree without communicating.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field, PositiveFloat

from labcrane import (
    Cue,
    Feedback,
    FloatArray,
    Frame,
    Machine,
    Offer,
    Run,
    Settings,
    Signal,
    hookimpl,
    offer,
)
from labcrane.core import ButtonName, Names, Shape, Sphere

labcrane_api = 1

PLACES = tuple((6.0, y, z) for z in (2.5, 3.5, 4.5) for y in (-1.5, 0.0, 1.5) if (y, z) != (0, 3.5))
"""Centres of the eight places, in metres in the machine's base frame: a ring ahead of the crane."""

LONGEST = 1000
"""Number of balls that are planned for a trial: more than any trial shows."""

PRESSED = 0.5


class NbackSettings(Settings):
    """Settings of the task; give ``nback`` and ``nback_ball`` the same."""

    back: int = Field(default=2, ge=1, le=4)
    """Number of balls back with which the place is compared."""

    period_s: PositiveFloat = 2.5
    """Time from one ball to the next, in seconds."""

    shown_s: PositiveFloat = 0.5
    """How long a ball is visible, in seconds."""

    match_share: float = Field(default=1 / 3, gt=0.0, lt=1.0)
    """Proportion of balls whose place matches."""

    button: ButtonName = "right.trigger"
    """The input's button with which the operator answers."""

    seed: int = 1
    """Seed of the order of places."""

    def needs(self, machine: Machine) -> Names:
        return {"button": [self.button]}


@dataclass(frozen=True)
class Order:
    """The balls of one trial."""

    places: tuple[int, ...]
    matches: tuple[bool, ...]


def order(settings: NbackSettings, trial: int) -> Order:
    """Return the places of a trial's balls, which depend only on the settings and the trial."""
    random = np.random.default_rng([settings.seed, trial])
    places: list[int] = []
    for number in range(LONGEST):
        same = number >= settings.back and random.random() < settings.match_share
        before = places[number - settings.back] if number >= settings.back else -1
        others = [place for place in range(len(PLACES)) if place != before]
        places.append(before if same else int(random.choice(others)))
    pairs = zip(places[settings.back :], places, strict=False)
    return Order(tuple(places), (False,) * settings.back + tuple(a == b for a, b in pairs))


class Course:
    """Find the ball that is shown in a frame."""

    def __init__(self, settings: NbackSettings) -> None:
        self._settings = settings
        self._trial = 0
        self._order = Order((), ())

    def ball(self, frame: Frame) -> tuple[int, int, bool, bool] | None:
        """Return the ball's number, place, match and visibility; None between trials."""
        if not frame.trial or (frame.task.size and np.isnan(frame.task).all()):
            return None  # between trials a task shows nothing
        if frame.trial != self._trial:
            self._trial, self._order = frame.trial, order(self._settings, frame.trial)
        number, since = divmod(frame.elapsed, self._settings.period_s)
        at = min(int(number), LONGEST - 1)
        seen = since < self._settings.shown_s
        return at, self._order.places[at], self._order.matches[at], seen


class NbackBall(Cue):
    """The ball."""

    signals = (Signal("ball", "1"), Signal("place", "1"))

    def __init__(self, settings: NbackSettings) -> None:
        self._course = Course(settings)

    def draw(self, frame: Frame) -> Sequence[Shape]:
        ball = self._course.ball(frame)
        if ball is None or not ball[3]:
            return ()
        return (Sphere("nback", PLACES[ball[1]], 0.4, (1.0, 0.9, 0.2, 1.0)),)

    def values(self, frame: Frame) -> FloatArray:
        ball = self._course.ball(frame)
        return np.array([np.nan, np.nan] if ball is None else [float(ball[0]), float(ball[1])])


class Nback(Feedback):
    """Send LSL markers and record the operator's answers."""

    signals = (Signal("ball", "1"), Signal("match", "1"), Signal("pressed", "1"))

    def __init__(self, settings: NbackSettings) -> None:
        self._settings = settings
        self._course = Course(settings)
        self._outlet = None
        self._last: tuple[int, int] | None = None
        self._down = False

    def open(self, run: Run) -> None:
        import pylsl

        self._button = run.axes.index(self._settings.button)
        info = pylsl.StreamInfo("nback", "Markers", 1, 0.0, "string", "labcrane-nback")
        self._outlet = pylsl.StreamOutlet(info)

    def present(self, frame: Frame) -> FloatArray:
        ball = self._course.ball(frame)
        if ball is None:
            return np.full(3, np.nan)
        number, place, match, _ = ball
        if (frame.trial, number) != self._last:
            self._last = (frame.trial, number)
            self._mark(frame, "ball", trial=frame.trial, ball=number, place=place, match=match)
        down = bool(frame.axes[self._button] > PRESSED)
        if down and not self._down:
            self._mark(frame, "press", trial=frame.trial, ball=number, right=match)
        self._down = down
        return np.array([number, match, down], dtype=np.float64)

    def close(self) -> None:
        self._outlet = None

    def _mark(self, frame: Frame, event: str, **data: object) -> None:
        # The timestamp is the tick's due time in the simulation, as for labcrane's own markers.
        self._outlet.push_sample([json.dumps({"event": event, **data})], frame.tick.due)


@hookimpl
def labcrane_cues() -> list[Offer[Cue]]:
    def build(settings: NbackSettings, machine: Machine) -> Cue:
        return NbackBall(settings)

    return [offer("nback_ball", NbackSettings, build)]


@hookimpl
def labcrane_feedback() -> list[Offer[Feedback]]:
    def build(settings: NbackSettings, machine: Machine) -> Feedback:
        return Nback(settings)

    return [offer("nback", NbackSettings, build)]
