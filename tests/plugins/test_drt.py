"""Detection response task: its timing, and its outcomes against a plain reading of ISO 17488."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import kstest

from labcrane import Cue, SecondaryTask, Tick
from labcrane.testing import (
    CueContract,
    SecondaryTaskContract,
    ch8,
    make_frame,
    make_run,
    make_trial,
    opened,
)
from labcrane_drt.drt import Drt
from labcrane_drt.light import Light
from labcrane_drt.settings import DrtSettings, LightSettings

RUN = make_run(ch8())
RATE_HZ = RUN.rate_hz
TRIGGER = RUN.axes.index("left.trigger")


class TestDrt(SecondaryTaskContract):
    """Offered as "drt"."""

    @pytest.fixture
    def secondary(self) -> SecondaryTask:
        return Drt(DrtSettings())


class TestLight(CueContract):
    """Offered as "stimulus_light"."""

    @pytest.fixture
    def cue(self) -> Cue:
        return Light(LightSettings(stimulus="target.radius"))


class Course:
    """What a task did, tick by tick, with a person at the trigger."""

    def __init__(
        self,
        ticks: Iterable[int],
        presses: Callable[[int], bool],
        seed: int = 1,
        **settings: object,
    ) -> None:
        self.onsets: list[int] = []
        self.presses: list[int] = []
        self.outcomes: list[tuple[int, str]] = []
        self.on: dict[int, bool] = {}
        drt = Drt(DrtSettings.model_validate(settings))
        with opened(drt, RUN):
            drt.begin_trial(make_trial(seed=seed))
            frame = make_frame(RUN)
            for tick in ticks:
                frame.tick = Tick(tick, tick / RATE_HZ, tick / RATE_HZ)
                frame.axes[TRIGGER] = presses(tick)
                status = drt.evaluate(frame)
                self.on[tick] = bool(status.values[0])
                for event in status.events:
                    if event.name == "drt.stimulus":
                        self.onsets.append(tick)
                    elif event.name == "drt.response":
                        self.presses.append(tick)
                    else:
                        self.outcomes.append((event.data["stimulus"], event.data["outcome"]))
            self.measured = drt.measure()


def never(tick: int) -> bool:
    return False


def by_the_standard(onsets: list[int], presses: list[int], until: int) -> list[str]:
    """Return the outcome of each stimulus that can be judged: a reading that shares no code."""
    found = []
    for number, onset in enumerate(onsets):
        if (until - onset) / RATE_HZ <= 2.5:  # a miss could not be told from a late hit
            continue
        following = onsets[number + 1] if number + 1 < len(onsets) else 10**9
        after = [(p - onset) / RATE_HZ for p in presses if onset < p <= following]
        first = min(after, default=99.0)
        found.append("miss" if first > 2.5 else "cheat" if first < 0.1 else "hit")
    return found


@pytest.mark.slow
def test_outcomes_are_those_of_the_standard_in_1000_drawn_streams() -> None:
    for seed in range(1000):
        random = np.random.default_rng(seed)
        length = round(20 * RATE_HZ)
        # Most presses come at random, some in every part of the time after a stimulus.
        held = np.zeros(length + 2000, bool)
        for press in random.integers(0, length, random.integers(0, 12)):
            held[press : press + random.integers(1, 100)] = True
        course = Course(range(length), lambda tick, held=held: bool(held[tick]), seed)
        edges = np.flatnonzero(held[1:length] & ~held[: length - 1]) + 1
        expected = by_the_standard(course.onsets, edges.tolist(), length - 1)
        assert [outcome for _, outcome in course.outcomes] == expected
        first = [
            min((p - onset) / RATE_HZ for p in edges if p > onset)
            for onset, outcome in zip(course.onsets, expected, strict=False)
            if outcome == "hit"
        ]
        hits, misses = expected.count("hit"), expected.count("miss")
        measured = course.measured
        assert (measured["hits"], measured["misses"]) == (hits, misses)
        assert measured["cheats"] == expected.count("cheat")
        assert measured["response_time"] == (pytest.approx(np.mean(first)) if first else None)
        assert measured["hit_rate"] == (hits / (hits + misses) if hits + misses else None)


@pytest.mark.parametrize("delay_ms", [50, 100, 250, 900, 2500, 2600])
def test_a_person_with_a_known_delay_is_measured_to_the_tick(delay_ms: int) -> None:
    onsets = Course(range(12_000), never).onsets
    delay = round(delay_ms / 1000 * RATE_HZ)
    course = Course(range(12_000), lambda tick: tick - delay in onsets)
    kind = "cheat" if delay_ms < 100 else "hit" if delay_ms <= 2500 else "miss"
    assert {outcome for _, outcome in course.outcomes} == {kind}
    if kind == "hit":
        assert course.measured["response_time"] == pytest.approx(delay_ms / 1000, abs=1 / RATE_HZ)


@pytest.mark.slow
def test_intervals_are_uniform_between_3_and_5_seconds() -> None:
    drawn = []
    for seed in range(20):
        onsets = Course(range(48_000), never, seed).onsets
        drawn += np.diff(onsets).tolist()
    seconds = np.array(drawn) / RATE_HZ
    assert len(seconds) > 800
    assert kstest(seconds, "uniform", (3.0, 2.0)).pvalue > 0.01


def test_a_stimulus_lasts_a_second_or_until_the_response() -> None:
    alone = Course(range(3000), never)
    onset = alone.onsets[0]
    assert sum(alone.on[tick] for tick in range(onset, onset + 700)) == RATE_HZ
    answered = Course(range(3000), lambda tick: tick == onset + 60)
    assert sum(answered.on[tick] for tick in range(onset, onset + 700)) == 60


def test_an_interruption_ends_the_stimulus_and_begins_a_new_interval() -> None:
    onset = Course(range(3000), never).onsets[0]
    gap = 5000
    course = Course([*range(onset + 10), *range(gap, gap + 3000)], lambda tick: tick == gap)
    assert course.outcomes[0] == (1, "held")
    assert course.measured["held"] == 1
    assert not course.on[gap]
    assert course.presses == []  # a button that is down when it goes on is not a response
    assert 3.0 * RATE_HZ <= course.onsets[1] - gap <= 5.0 * RATE_HZ


def test_the_interval_goes_on_from_one_trial_to_the_next() -> None:
    drt, onsets = Drt(DrtSettings()), []
    with opened(drt, RUN):
        for tick in range(10_000):
            if tick % 500 == 0:  # two seconds: shorter than any interval
                drt.begin_trial(make_trial(seed=tick))
            if any(e.name == "drt.stimulus" for e in drt.evaluate(make_frame(RUN, tick)).events):
                onsets.append(tick)
    seconds = np.diff(onsets) / RATE_HZ
    assert len(seconds) > 7
    assert seconds.min() >= 3.0 - 1 / RATE_HZ
    assert seconds.max() <= 5.0 + 1 / RATE_HZ


def test_a_response_that_could_be_of_two_stimuli_is_refused() -> None:
    with pytest.raises(ValidationError, match="write a longer interval_s"):
        DrtSettings(interval_s=(2.0, 3.0))


def test_short_trials_do_not_raise_the_hit_rate() -> None:
    """Hits that counted at once, beside misses that need 2.5 s, gave 0.84 where 0.7 is true."""
    random, found = np.random.default_rng(5), {"hits": 0, "misses": 0}
    for seed in range(400):
        trial = range(int(7.0 * RATE_HZ))  # and a gap before the next one
        onsets = Course(trial, never, seed).onsets
        hit = {onset + int(0.5 * RATE_HZ) for onset in onsets if random.random() < 0.7}
        course = Course(trial, hit.__contains__, seed)
        for name in found:
            found[name] += course.measured[name]
    judged = found["hits"] + found["misses"]
    assert judged > 40
    assert abs(found["hits"] / judged - 0.7) < 3.0 * np.sqrt(0.7 * 0.3 / judged)
