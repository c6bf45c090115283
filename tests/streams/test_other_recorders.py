"""Streams of other recorders: offsets alone, no arrivals, and stamps that go back."""

from dataclasses import replace

import numpy as np
import pytest
from streams.unkind import START, Clock, received, regular

from labcrane.core import Verdict
from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.raw import RawStream
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_quality


def restarting(random: np.random.Generator, rate: float) -> tuple[RawStream, np.ndarray]:
    """A computer that restarts once or more often: each time its clock begins at a minute or so."""
    stamps, probes, truth, now = [], [], [], 1000.0
    for k in range(int(random.integers(2, 5))):
        length = random.uniform(20.0, 80.0)
        up = random.uniform(40.0, 300.0) if k else random.uniform(1e4, 1e6)
        if rate:
            taken = now + np.arange(int(length * rate)) / rate
        else:
            taken = now + np.sort(random.uniform(0.0, length, int(random.integers(8, 100))))
        at = np.arange(now + 0.1, now + length, random.uniform(1.0, 5.0))
        truth.append(taken)
        stamps.append(taken - now + up)
        told = at - now + up
        probes.append(np.column_stack([told, at - told, np.full(len(at), 1e-3), at + 1.2]))
        now += length + random.uniform(40.0, 200.0)
    return RawStream(np.concatenate(stamps), np.concatenate(probes)), np.concatenate(truth)


@pytest.mark.parametrize("rate", [0.0, 100.0])
@pytest.mark.parametrize("seed", range(8))
def test_samples_of_a_computer_that_restarted_are_of_the_clock_they_follow(
    seed: int, rate: float
) -> None:
    """Its markers were placed half a million seconds early, though the file has them in order."""
    raw, truth = restarting(np.random.default_rng([seed, int(rate)]), rate)
    corrected = correct(raw, Treatment(rate))
    off = np.abs(corrected.time - truth)
    sure = corrected.error < 1.0
    assert sure.mean() > 0.5
    assert off[sure].max() < 1e-3
    assert np.mean(off <= corrected.error) >= 0.99
    assert not rate or sure.all()
    assert corrected.quality.disordered == 0


@pytest.mark.parametrize("right", ["before", "behind"])
@pytest.mark.parametrize("seed", range(4))
def test_stamps_that_go_back_while_offsets_go_on_state_it(seed: int, right: str) -> None:
    """They passed with a warning and 0.5 ms, and half of them were 800 ms off."""
    random = np.random.default_rng([seed, *right.encode()])
    rate = float(random.choice([60.0, 250.0, 500.0]))
    times = regular(random, rate, 100.0, 200.0)
    back, at = random.uniform(0.6, 5.0), int(random.uniform(0.2, 0.8) * len(times))
    wrong = np.where(np.arange(len(times)) >= at, -back, 0.0)
    if right == "behind":
        wrong += back
    scatter = random.uniform(-1.0, 1.0, len(times)) * random.uniform(0.0, 0.2) / rate
    clock = Clock(random)
    drawn = received(random, clock, times + scatter, rate, stamped=times + scatter + wrong)
    raw = RawStream(drawn.raw.stamps, drawn.raw.probes)
    corrected = correct(raw, drawn.treatment)
    assert np.mean(np.abs(corrected.time - drawn.truth) <= corrected.error) >= 0.99
    told = judge_quality(corrected.quality, rate, len(times), Limits())
    assert any(each.verdict is Verdict.FAIL and "may be off by" in each.text for each in told)
    assert any("placed before one that arrived earlier" in each.text for each in told)
    assert corrected.quality.rate_hz == pytest.approx(rate, rel=1e-3)


def test_markers_that_go_back_by_less_than_their_clock_may_be_of_either_side() -> None:
    """Between two probes nothing shows which: they state the whole step."""
    random = np.random.default_rng(3)
    clock = Clock(random)
    times = START + np.sort(random.uniform(0.0, 100.0, 50))
    clock.step(-0.8, START + 50.0)
    drawn = received(random, clock, times, 0.0)
    raw = replace(drawn.raw, arrivals=np.empty((0, 2)))
    corrected = correct(raw, drawn.treatment)
    assert np.mean(np.abs(corrected.time - drawn.truth) <= corrected.error) >= 0.99
    assert corrected.quality.steps == 1


@pytest.mark.parametrize("seed", range(20))
def test_stamps_that_go_back_by_whole_periods_state_it(seed: int) -> None:
    """They equal earlier ones, as samples do that are sent again."""
    random = np.random.default_rng(seed)
    period = float(random.choice([0.001, 0.002, 0.004, 0.01]))
    times = 1000.0 + np.arange(int(60.0 / period)) * period
    back = int(10.0 ** random.uniform(-1.5, 0.7) / period)
    at = int(random.uniform(0.2, 0.8) * len(times))
    stamps = np.where(np.arange(len(times)) < at, times, np.roll(times, back))
    told = np.arange(1000.0, 1060.0, 5.0)
    shown = np.column_stack([told, np.zeros(len(told)), np.full(len(told), 1e-3), told])
    corrected = correct(RawStream(stamps, shown), Treatment(1.0 / period))
    assert np.mean(np.abs(corrected.time - times) <= corrected.error) >= 0.99
    assert corrected.quality.rate_hz == pytest.approx(1.0 / period, rel=1e-3)


@pytest.mark.parametrize("seed", range(20))
def test_markers_whose_clock_was_set_back_state_it_where_one_lies_behind_another(seed: int) -> None:
    """Offsets went on, and half of the markers were up to 0.8 s off with 1 ms stated."""
    random = np.random.default_rng(seed)
    times = START + np.sort(random.uniform(0.0, 300.0, int(random.integers(100, 800))))
    at, back = int(random.integers(20, len(times) - 20)), random.uniform(0.05, 5.0)
    stamps = np.where(np.arange(len(times)) < at, times, times - back)
    told = np.arange(START, START + 300.0, 5.0)
    shown = np.column_stack([told, np.zeros(len(told)), np.full(len(told), 1e-3), told])
    corrected = correct(RawStream(stamps, shown), Treatment())
    if stamps[at] > stamps[at - 1]:
        assert corrected.quality.backward == 0
        return
    assert np.mean(np.abs(corrected.time - times) <= corrected.error) >= 0.99
    assert corrected.quality.backward > 0
    told_of = judge_quality(corrected.quality, 0.0, len(times), Limits())
    assert any("its clock was set back" in each.text for each in told_of)


def test_markers_sent_late_again_and_again_keep_their_times() -> None:
    """A program that stamps answers when they were given, and sends them with what follows."""
    random = np.random.default_rng(4)
    times = START + np.sort(random.uniform(0.0, 300.0, 400))
    late = times.copy()
    late[10::40], late[11::40] = times[11::40], times[10::40]
    told = np.arange(START, START + 300.0, 5.0)
    shown = np.column_stack([told, np.zeros(len(told)), np.full(len(told), 1e-3), told])
    corrected = correct(RawStream(late, shown), Treatment())
    assert corrected.error.max() < 0.002
    assert corrected.quality.disordered == 10
