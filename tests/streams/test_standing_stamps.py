"""Stamps that say nothing: none, or the same for ever."""

from dataclasses import replace

import numpy as np
import pytest
from streams.unkind import START, Clock, received, regular

from labcrane.streams.sync.correction import correct
from labcrane.streams.sync.quality import Basis
from labcrane.streams.sync.raw import RawStream
from labcrane.streams.sync.report.certificate import Fault, faults

STANDING = {
    "all equal": lambda stamps: np.full(len(stamps), stamps[0]),
    "all zero": lambda stamps: np.zeros(len(stamps)),
    "none": lambda stamps: np.full(len(stamps), np.nan),
    "endless": lambda stamps: np.full(len(stamps), np.inf),
}


def drawn_of(random, rate):
    times = regular(random, 250.0, 30.0, 60.0)
    if not rate:
        times = START + np.sort(random.uniform(0.0, 60.0, 400))
    return received(random, Clock(random), times, rate)


@pytest.mark.parametrize("what", STANDING)
@pytest.mark.parametrize("rate", [0.0, 250.0])
def test_samples_whose_stamps_say_nothing_are_placed_by_their_arrival(
    what: str, rate: float
) -> None:
    """It ended in a division by zero, and live the stream stayed uncorrected."""
    drawn = drawn_of(np.random.default_rng(8), rate)
    raw = replace(drawn.raw, stamps=STANDING[what](drawn.raw.stamps))
    corrected = correct(raw, drawn.treatment)
    assert np.mean(np.abs(corrected.time - drawn.truth) <= corrected.error) >= 0.99
    assert (corrected.basis == list(Basis).index(Basis.ARRIVALS)).all()
    assert corrected.quality.unprobed == len(raw.stamps)
    unknown = correct(replace(raw, arrivals=np.empty((0, 2))), drawn.treatment)
    assert np.isnan(unknown.time).all()
    assert (unknown.basis == list(Basis).index(Basis.NOTHING)).all()


@pytest.mark.parametrize("rate", [0.0, 250.0])
@pytest.mark.parametrize("seed", range(3))
def test_samples_without_a_stamp_change_nothing_of_the_others(seed: int, rate: float) -> None:
    random = np.random.default_rng(seed)
    drawn = drawn_of(random, rate)
    stamps = drawn.raw.stamps.copy()
    gone = random.random(len(stamps)) < random.uniform(0.001, 0.05)
    gone[5] = True
    stamps[gone] = random.choice([np.nan, np.inf])
    corrected = correct(replace(drawn.raw, stamps=stamps), drawn.treatment)
    off = np.abs(corrected.time - drawn.truth)
    assert off[~gone].max() < 1e-4
    assert corrected.error[~gone].max() < 1e-3
    assert (off <= corrected.error)[gone].mean() >= 0.95
    assert corrected.quality.unprobed == gone.sum()


@pytest.mark.parametrize("count", [1, 2, 3, 19, 20, 40])
@pytest.mark.parametrize("rate", [0.0, 250.0])
def test_few_samples_of_one_stamp_end_no_correction(count: int, rate: float) -> None:
    drawn = drawn_of(np.random.default_rng(2), rate)
    raw = replace(drawn.raw, stamps=np.full(count, drawn.raw.stamps[0]))
    assert len(correct(raw, drawn.treatment).time) == count


@pytest.mark.parametrize("arrivals", [True, False])
@pytest.mark.parametrize("share", [0.01, 0.15, 0.3, 0.45, 0.65])
def test_stamps_that_stand_for_any_part_of_a_recording_are_named_and_stated(
    share: float, *, arrivals: bool
) -> None:
    random = np.random.default_rng([int(100 * share), arrivals])
    drawn = drawn_of(random, 250.0)
    count = len(drawn.raw.stamps)
    begin = int(random.uniform(0.05, 0.9 - share) * count)
    stamps = drawn.raw.stamps.copy()
    stamps[begin : begin + int(share * count)] = stamps[begin]
    raw = replace(drawn.raw, stamps=stamps)
    if not arrivals:
        raw = RawStream(stamps, raw.probes)
    corrected = correct(raw, drawn.treatment)
    assert np.mean(np.abs(corrected.time - drawn.truth) <= corrected.error) >= 0.99
    assert Fault.FROZEN in faults(corrected.quality, 250.0)
