"""Pauses and lost samples: what cannot be known is stated, and no stamp is moved for it."""

import numpy as np
import pytest
from streams.pausing import ROWS, stalling
from streams.unkind import START, Clock, received

from labcrane import clocks
from labcrane.streams.sync.correction import correct
from labcrane.streams.sync.report.certificate import Fault, faults
from labcrane.streams.sync.stamping.shifts import MOST_S, Shifts

WORSE_S = 1e-4


def drawn_of(row: str, seed: int):
    return ROWS[row](np.random.default_rng([seed, *row.encode()]))


def judge(row: str, seed: int) -> None:
    """Check a draw's promises: moved no further than stated, counted, and timed."""
    paused = drawn_of(row, seed)
    drawn = paused.drawn
    corrected = correct(drawn.raw, drawn.treatment)
    off, uneven_off = (np.abs(t - drawn.truth) for t in (corrected.time, corrected.uneven))
    assert np.mean(off <= corrected.error) >= 0.99
    assert (np.abs(corrected.time - corrected.uneven) <= corrected.error).all()
    assert np.quantile(off, 0.95) <= np.quantile(uneven_off, 0.95) + WORSE_S
    assert off.max() <= uneven_off.max() + WORSE_S
    quality, period = corrected.quality, 1.0 / drawn.treatment.rate_hz
    assert quality.gaps == paused.holes
    assert quality.longest_gap_s == pytest.approx(
        paused.longest_s, abs=(2.0 * paused.scatter + 0.01) * period
    )
    assert quality.rate_hz == pytest.approx(drawn.treatment.rate_hz, rel=1e-3)
    named = faults(quality, drawn.treatment.rate_hz)
    either = {Fault.LOST, Fault.INTERRUPTED, Fault.SHIFTED, Fault.NOISY}
    assert named <= either
    assert (Fault.INTERRUPTED in named) == (quality.longest_gap_s > 1.0)
    if row.startswith("samples lost"):
        assert quality.dropped == pytest.approx(paused.missing, rel=2e-3, abs=2)


@pytest.mark.parametrize("row", ROWS)
@pytest.mark.parametrize("seed", range(2))
def test_no_stamp_is_moved_for_a_hole_and_each_is_counted(row: str, seed: int) -> None:
    judge(row, seed)


@pytest.mark.soak
@pytest.mark.parametrize("row", ROWS)
def test_in_fifty_draws_no_stamp_is_moved_for_a_hole_and_each_is_counted(row: str) -> None:
    first = int(np.random.SeedSequence().generate_state(1)[0])
    failed = []
    for seed in range(first, first + 50):
        try:
            judge(row, seed)
        except AssertionError as error:
            failed.append((seed, str(error).splitlines()[0]))
    assert not failed


@pytest.mark.parametrize("counted", [False, True])
def test_an_eye_lost_thirteen_times_moves_no_stamp_and_is_named(*, counted: bool) -> None:
    """Each pause was taken for a buffer that grew: stamps were 1.2 s off in the middle."""
    random = np.random.default_rng(40 + counted)
    steps = np.full(6600, 1.0 / 120.0)
    at = np.sort(random.choice(np.arange(100, 6500, 20), 13, replace=False))
    steps[at] += random.uniform(0.1, 0.24, 13)
    times = START + np.cumsum(steps)
    index = np.arange(6600.0) if counted else None
    drawn = received(random, Clock(random), times, 120.0, index=index)
    corrected = correct(drawn.raw, drawn.treatment)
    assert np.array_equal(corrected.time, corrected.uneven)
    assert np.abs(corrected.time - times).max() < 1e-4
    assert MOST_S < corrected.error.max() < MOST_S + 0.001
    named = faults(corrected.quality, 120.0)
    assert Fault.SHIFTED in named
    assert Fault.CHANGED_RATE not in named
    assert corrected.quality.gaps == 13


def test_shifts_to_later_add_up_to_no_more_than_a_buffer_holds() -> None:
    random = np.random.default_rng(7)
    for _ in range(100):
        count = int(random.integers(1, 60))
        at = np.sort(random.integers(1, 1000, count)).astype(np.intp)
        by = random.uniform(0.0, 0.4, count)
        open_s = Shifts(at, by).open_s(1000)
        assert open_s.max() == pytest.approx(min(by.sum(), MOST_S))
        assert Shifts(at, -by).open_s(1000).max() == pytest.approx(by.sum())
        assert open_s.min() >= 0.0


@pytest.mark.parametrize("arrivals", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_missing_that_a_burst_behind_a_stall_holds(seed: int, *, arrivals: bool) -> None:
    """A stall of 1.1 s was told as 347 lost samples, forty of them as 397 Hz in place of 250."""
    drawn = stalling(np.random.default_rng(seed), arrivals=arrivals)
    corrected = correct(drawn.raw, drawn.treatment)
    quality = corrected.quality
    assert quality.dropped == 0
    assert quality.gaps == 0
    assert quality.rate_hz == pytest.approx(drawn.treatment.rate_hz, rel=2e-3)
    assert np.mean(np.abs(corrected.time - drawn.truth) <= corrected.error) >= 0.95


def test_scatter_that_arrivals_show_stays_stated_where_brief_pauses_forbid_evening() -> None:
    """Evening was refused in some draws, and their 1.6 ms of scatter were forgotten: 0.6 stated."""
    at = np.arange(0.0, 60.0, 2.0)
    probes = np.column_stack([at, np.zeros(30), np.full(30, 2e-4)])
    kept = 0
    for seed in range(30):
        random = np.random.default_rng(seed)
        steps = np.full(7000, 1.0 / 120.0)
        at = random.choice(np.arange(180, 6900), 40, replace=False)
        steps[at] += random.uniform(2e-3, 0.02, 40)
        times = np.cumsum(steps)
        came = np.maximum.accumulate(times + 1e-3 + random.exponential(5e-4, len(times)))
        noise = random.normal(0.0, 0.1 / 120.0, len(times))
        corrected = clocks.correct(times + noise, probes=probes, arrivals=came, rate_hz=120.0)
        if np.array_equal(corrected.time, corrected.uneven):
            kept += 1
            assert np.mean(np.abs(corrected.time - times) <= corrected.error) >= 0.95
    assert kept > 0
