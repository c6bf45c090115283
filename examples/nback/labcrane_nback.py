"""A spatial n-back task during the movements: balls appear at changing places.

The operator presses a button when the place is the same as ``back`` balls ago. Every view draws the
ball, since its signals are called ``position`` and ``radius``. The places depend only on settings
and the trial's seed.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import Field, PositiveFloat

from labcrane import (
    Frame,
    Machine,
    Offer,
    Run,
    SecondaryTask,
    Settings,
    Signal,
    Trial,
    hookimpl,
    offer,
)
from labcrane.core import ButtonName, Event, Names, Phase, TrialStatus, Value

labcrane_api = 1

PLACES = tuple((6.0, y, z) for z in (2.5, 3.5, 4.5) for y in (-1.5, 0.0, 1.5) if (y, z) != (0, 3.5))
"""Centres of the eight places, in metres in the machine's base frame: a ring ahead of the crane."""

LONGEST = 1000
"""Number of balls that are planned for a trial: more than any trial shows."""

RADIUS = 0.4
"""Of a ball, in metres."""

PRESSED = 0.5


class NbackSettings(Settings):
    """Settings of the task."""

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

    def needs(self, machine: Machine) -> Names:
        return {"button": [self.button]}

    def provides(self, machine: Machine) -> Names:
        return {"event": ["nback.ball", "nback.press"], "object": ()}


@dataclass(frozen=True)
class Order:
    """The balls of one trial."""

    places: tuple[int, ...]
    matches: tuple[bool, ...]


def order(settings: NbackSettings, seed: int) -> Order:
    """Return the places of a trial's balls, which depend only on the settings and the seed."""
    random = np.random.default_rng(seed)
    places: list[int] = []
    for number in range(LONGEST):
        same = number >= settings.back and random.random() < settings.match_share
        before = places[number - settings.back] if number >= settings.back else -1
        others = [place for place in range(len(PLACES)) if place != before]
        places.append(before if same else int(random.choice(others)))
    pairs = zip(places[settings.back :], places, strict=False)
    return Order(tuple(places), (False,) * settings.back + tuple(a == b for a, b in pairs))


class Nback(SecondaryTask):
    """Shows the balls, and judges the operator's answers."""

    signals = (
        Signal("ball.position", "m", ("x", "y", "z")),
        Signal("ball.radius", "m"),
        Signal("number", "1"),
        Signal("match", "1"),
        Signal("pressed", "1"),
    )
    results = (
        Signal(
            "hit_share",
            "1",
            definition="share of the matches with a press; a ball cut off at the end is left out",
        ),
        Signal("false_share", "1", definition="share of the other balls with one"),
    )

    def __init__(self, settings: NbackSettings) -> None:
        self._settings = settings
        self._down = False

    def open(self, run: Run) -> None:
        self._button = run.axes.index(self._settings.button)
        self._rate_hz = run.rate_hz

    def begin_trial(self, trial: Trial) -> None:
        self._order = order(self._settings, trial.seed)
        self._ticks, self._number = 0, -1
        self._answered: list[bool] = []

    def evaluate(self, frame: Frame) -> TrialStatus:
        settings, events = self._settings, []
        number, since = divmod(self._ticks / self._rate_hz, settings.period_s)
        number, self._ticks = min(int(number), LONGEST - 1), self._ticks + 1
        place, match = self._order.places[number], self._order.matches[number]
        if number != self._number:
            self._number = number
            self._answered.append(False)
            about: dict[str, Value] = {"ball": number, "place": place, "match": match}
            events.append(Event("nback.ball", frame.tick.due, about))
        before, self._down = self._down, bool(frame.axes[self._button] > PRESSED)
        if self._down and not before:
            self._answered[-1] = True
            events.append(Event("nback.press", frame.tick.due, {"ball": number, "right": match}))
        shown = PLACES[place] if since < settings.shown_s else (np.nan,) * 3
        values = np.array([*shown, RADIUS, number, match, self._down], np.float64)
        return TrialStatus(Phase.RUNNING, values, tuple(events))

    def measure(self) -> Mapping[str, Value]:
        # A ball that the end of the trial cuts off was perhaps still to be answered.
        whole = int(round(self._ticks / self._rate_hz / self._settings.period_s, 9))
        answered = np.array(self._answered[:whole], np.bool_)
        matches = np.array(self._order.matches[: len(answered)])
        parts = {"hit_share": answered[matches], "false_share": answered[~matches]}
        return {name: float(part.mean()) if part.size else None for name, part in parts.items()}


@hookimpl
def labcrane_secondary() -> list[Offer[SecondaryTask]]:
    return [offer("nback", NbackSettings, Nback)]
