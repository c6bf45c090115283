"""The detection response task, tick by tick."""

from collections.abc import Mapping

import numpy as np

from labcrane import FloatArray, Frame, Run, SecondaryTask, Signal, Trial
from labcrane.core import Event, Phase, TrialStatus, Value
from labcrane_drt.settings import DrtSettings

SALT = 17488
"""Keeps the intervals apart from all else that is drawn from a trial's seed."""


class Drt(SecondaryTask):
    """Gives a stimulus every 3 to 5 s, and waits for the response (ISO 17488:2016).

    The intervals go on from one trial to the next, as long as no tick is missing between them. A
    pause, a fault, a break or a question ends the stimulus under way without an outcome; the next
    one comes an interval after the end of the interruption.

    A stimulus has an outcome only when all of the time for a response was watched, whatever the
    response. Hits that count at once, beside misses that need that time, would raise the hit rate
    of short trials.
    """

    signals = (
        Signal("stimulus", "1", definition="1 while a stimulus is on, else 0"),
        Signal("response", "1", definition="1 while the response is pressed, else 0"),
    )
    results = (
        Signal("hits", "1", definition="stimuli with a response in the time of a hit"),
        Signal("misses", "1", definition="stimuli without a response, or with a late one"),
        Signal("cheats", "1", definition="stimuli with a response too early to be one"),
        Signal("held", "1", definition="stimuli that an interruption ended; they do not count"),
        Signal("hit_rate", "1", definition="hits divided by hits and misses; cheats are left out"),
        Signal("response_time", "s", definition="mean response time of the hits"),
        Signal("median_response_time", "s", definition="median response time of the hits"),
    )

    def __init__(self, settings: DrtSettings) -> None:
        self._settings = settings
        self._random = np.random.default_rng(SALT)
        self._last = -2  # tick; the first one follows none
        self._next = 0
        self._onset = -1
        self._waiting = self._on = self._down = False
        self._answered = np.nan
        self._stimulus = 0
        self._status, self._said = TrialStatus(Phase.RUNNING, np.zeros(2)), (False, False)
        self._outcomes: dict[str, list[float]] = {}

    def open(self, run: Run) -> None:
        name = self._settings.response
        self._axis = run.axes.index(name.removeprefix("-"))
        self._sign = -1.0 if name.startswith("-") else 1.0
        self._rate_hz = run.rate_hz

    def begin_trial(self, trial: Trial) -> None:
        self._random = np.random.default_rng([trial.seed, SALT])
        self._outcomes = {name: [] for name in ("hit", "miss", "cheat", "held")}

    def evaluate(self, frame: Frame) -> TrialStatus:
        tick, settings = frame.tick, self._settings
        events: list[Event] = []
        before, self._down = self._down, self._pressed(frame.axes)
        pressed = self._down and not before
        if tick.number != self._last + 1:
            if self._waiting:
                events.append(self._decided(tick.due, "held", np.nan))
            self._next, self._on, pressed = self._after(tick.number), False, False
        self._last = tick.number
        since = (tick.number - self._onset) / self._rate_hz
        if pressed:
            events.append(Event("drt.response", tick.due, {"stimulus": self._stimulus}))
            self._on = False
            self._answered = np.fmin(self._answered, since)
        if self._waiting and since > settings.hit_s[1]:
            least, most = settings.hit_s
            answered = self._answered
            outcome = "cheat" if answered < least else "hit" if answered <= most else "miss"
            events.append(self._decided(tick.due, outcome, answered))
        if self._on and since >= settings.longest_s:
            self._on = False
        if tick.number >= self._next:
            self._stimulus += 1
            self._onset, self._on, self._waiting = tick.number, True, True
            self._answered = np.nan
            self._next = self._after(tick.number)
            events.append(Event("drt.stimulus", tick.due, {"stimulus": self._stimulus}))
        if events or (self._on, self._down) != self._said:
            self._said = (self._on, self._down)
            values = np.array(self._said, np.float64)
            self._status = TrialStatus(Phase.RUNNING, values)
            return TrialStatus(Phase.RUNNING, values, tuple(events))
        return self._status

    def measure(self) -> Mapping[str, Value]:
        found = self._outcomes
        hits, misses = len(found["hit"]), len(found["miss"])
        return {
            "hits": hits,
            "misses": misses,
            "cheats": len(found["cheat"]),
            "held": len(found["held"]),
            "hit_rate": hits / (hits + misses) if hits + misses else None,
            "response_time": float(np.mean(found["hit"])) if hits else None,
            "median_response_time": float(np.median(found["hit"])) if hits else None,
        }

    def _pressed(self, axes: FloatArray) -> bool:
        return bool(self._sign * axes[self._axis] > self._settings.threshold)

    def _after(self, tick: int) -> int:
        """Return the tick of the next onset, an interval after another tick."""
        return tick + round(self._random.uniform(*self._settings.interval_s) * self._rate_hz)

    def _decided(self, time: float, outcome: str, since: float) -> Event:
        self._waiting = False
        self._outcomes[outcome].append(since)
        data: dict[str, Value] = {"stimulus": self._stimulus, "outcome": outcome}
        return Event("drt.outcome", time, data)
