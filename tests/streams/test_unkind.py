"""Corrections of unkind devices and clocks, drawn at random, against what really was."""

from dataclasses import replace

import numpy as np
import pytest
from streams.strangers import ALL as ROWS
from streams.strangers import alike_to_both_sides, ramping
from streams.unkind_score import Score, coverage, draw, misnamed, score, shortcomings, worse_rows
from streams.unkinder import quiet_at_last

from labcrane.streams.sync.correction import correct
from labcrane.streams.sync.offset import fit
from labcrane.streams.sync.report.certificate import Fault, faults
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_quality

QUICK = (
    "the receiver's clock, a little off",
    "a clock ahead of the probed one",
    "a clock behind the probed one",
    "a clock that drifts away",
    "a pause that the counter does not show",
    "markers stamped with the flip to come",
    "the same, on our own computer",
    "stamps that stand still",
    "stamps cut to a coarse unit",
    "a camera that takes longer in the dark",
    "a clock behind by less than a millisecond",
    "markers of which some are lost",
    "markers out of order",
    "markers that stall and come in bursts",
    "markers whose program died",
    "60 Hz, single samples lost",
    "markers, wander and step",
    "rate changes at once",
    "stamps of the receiver's clock",
    "stalls and bursts",
    "chunks stamped when sent, under load",
    "the same, and samples lost",
    "even samples stamped when a serial port is read",
    "even samples stamped by polls of a bus",
    "even samples stamped when a radio has its turn",
    "a buffer that grows",
    "a buffer that grows, a counter",
    "a buffer that shrinks",
    "chunks stamped by a wrong rate",
    "every sample sent several times",
    "chunks sent again",
    "several samples of one stamp",
    "ticks of an odd timer",
    "stamps in single precision",
    "a guest whose clock stands still and catches up",
    "even samples stamped after one of two delays",
    "even samples, two of one poll now and then",
)


def scores(row: str, draws: int, first: int = 0) -> list[Score]:
    return [score(row, first + seed, usual=True) for seed in range(draws)]


@pytest.mark.parametrize("seed", range(1, 5))
def test_a_slew_is_covered_that_probes_of_a_busy_computer_show_late(seed: int) -> None:
    one = score("slewed, and its computer busy", seed)
    assert one.cover >= 0.95
    assert not one.passed or one.most <= 1.0
    assert shortcomings(one) == []
    assert one.named == one.present


@pytest.mark.parametrize(
    ("row", "draws"),
    [*((row, 1) for row in QUICK), *(pytest.param(row, 2, marks=pytest.mark.long) for row in ROWS)],
)
def test_an_unkind_device_is_as_right_as_it_is_said_to_be(row: str, draws: int) -> None:
    for one in scores(row, draws):
        assert shortcomings(one) == [], one
        assert one.named == one.present


@pytest.mark.parametrize("seed", range(10))
def test_a_sampler_that_is_uneven_keeps_its_stamps(seed: int) -> None:
    """A camera's evened times were off by seconds."""
    drawn = draw("a camera that takes longer in the dark", seed)
    corrected = correct(drawn.raw, drawn.treatment)
    assert np.array_equal(corrected.time, corrected.uneven)


@pytest.mark.parametrize("seed", range(6))
def test_delays_that_nothing_tells_from_uneven_samples_do_not_pass(seed: int) -> None:
    """Arrivals go with the stamps, and both scatter by chance: neither is shown to be wrong."""
    drawn = alike_to_both_sides(np.random.default_rng(seed))
    corrected = correct(drawn.raw, drawn.treatment)
    assert np.abs(corrected.time - drawn.truth).max() > 1e-3
    told = judge_quality(corrected.quality, 250.0, len(drawn.truth), Limits())
    assert any("its samples are irregular, or late by as much" in each.text for each in told)
    assert faults(corrected.quality, 250.0) == set()


@pytest.mark.slow
def test_delays_that_grow_slowly_and_pass_at_once_are_in_the_error_where_they_are_named() -> None:
    """Each passing looked like a buffer that shrank, and as many of them added up."""
    named = 0
    for seed in range(6):
        drawn = ramping(np.random.default_rng(seed))
        corrected = correct(drawn.raw, drawn.treatment)
        if Fault.SHIFTED in faults(corrected.quality, 250.0):
            named += 1
            assert np.mean(np.abs(corrected.time - drawn.truth) <= corrected.error) >= 0.95
    assert named >= 3


@pytest.mark.parametrize("seed", range(6))
def test_the_unit_of_our_own_clock_is_in_the_error(seed: int) -> None:
    """Round trips are none or one unit, and our readings are half of it early."""
    random = np.random.default_rng(seed)
    at = 1000.0 + np.cumsum(random.uniform(1.0, 2.0, 200))
    half = random.uniform(2e-5, 4e-4)
    sent, back = (np.floor(1e3 * when) / 1e3 for when in (at - half, at + half))
    probes = np.column_stack([at, (sent + back) / 2.0 - at, back - sent])
    offset, error = fit(probes, 0.0).with_error(at)
    assert (np.abs(offset) <= error).mean() >= 0.95


@pytest.mark.parametrize("one_way", [-1.0, 1.0])
def test_what_the_shortest_round_trip_hides_is_in_the_error(one_way: float) -> None:
    """All of each round trip may lie on one way, and then the offset is wrong by half of it."""
    at = 1000.0 + np.arange(0.0, 200.0, 2.0)
    trip = 4e-4
    probes = np.column_stack([at, np.full(len(at), one_way * trip / 2.0), np.full(len(at), trip)])
    offset, error = fit(probes, 0.0).with_error(at)
    assert np.abs(offset).min() > 0.49 * trip
    assert (np.abs(offset) <= error).all()


@pytest.mark.slow
def test_markers_whose_program_goes_on_did_not_die() -> None:
    for seed in range(10):
        drawn = quiet_at_last(np.random.default_rng(seed))
        assert drawn.end is not None
        assert drawn.end - drawn.truth[-1] > 100.0
        named = faults(correct(drawn.raw, drawn.treatment, drawn.end).quality, 0.0)
        assert named == {Fault.LOST}


def test_every_fault_that_a_report_can_name_is_drawn_and_its_names_are_counted() -> None:
    drawn = {fault for row in ROWS for fault in draw(row, 0).faults}
    assert drawn == set(Fault)


def a_score(**changes: object) -> Score:
    good = Score(
        row="a device", p95=0.02, most=0.1, cover=1.0, width=0.1, passed=True, usual=0.1,
        untouched=9.0, named=frozenset(), present=frozenset(), clean=True, limit=0.1, samples=100,
        apart=0.02, usual_apart=0.1, apart_limit=np.inf, chance=False,
    )  # fmt: skip
    return replace(good, **changes)


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({}, []),
        ({"p95": 0.11}, ["error beyond 0.1 ms"]),
        ({"p95": 0.11, "clean": False}, []),
        ({"untouched": -0.09}, ["worse than no correction"]),
        ({"apart": 0.21}, ["worse than pyxdf"]),
        ({"apart": 0.21, "chance": True}, []),
        ({"apart_limit": 0.01}, ["error beyond 0.01 ms beside what is hidden"]),
        ({"cover": 0.94}, ["not covered"]),
        ({"width": 0.31}, ["uncertainty wider than 0.3 ms"]),
        ({"most": 1.01}, ["PASS beyond 1 ms"]),
        ({"most": 1.01, "passed": False}, []),
    ],
)
def test_each_promise_is_broken_by_what_breaks_it(
    changes: dict[str, object], broken: list[str]
) -> None:
    assert shortcomings(a_score(**changes)) == broken


def test_faults_left_out_and_named_for_nothing_are_counted_over_the_draws() -> None:
    there = frozenset({Fault.STEPPED})
    draws = [a_score(named=there, present=there)] * 18
    draws += [a_score(present=there), a_score(named=there | {Fault.SLEPT}, present=there)]
    found = misnamed([*draws, a_score(named=there)])
    assert found == {Fault.STEPPED: (0.95, 0.95), Fault.SLEPT: (0.0, 1.0)}


def test_a_device_is_worse_by_its_mean_or_by_the_worst_of_twenty_draws() -> None:
    even = [
        a_score(row="even", chance=True, p95=0.15 + 0.1 * (k % 2), usual=0.2) for k in range(20)
    ]
    mean = [a_score(row="mean", p95=0.31, usual=0.2) for _ in range(20)]
    tail = [a_score(row="tail", p95=0.4 if k < 2 else 0.1, usual=0.2) for k in range(20)]
    assert worse_rows([*even, *mean, *tail]) == ["mean", "tail"]


def test_two_unlucky_draws_of_a_coarse_unit_say_nothing_and_fifty_that_are_worse_do() -> None:
    random = np.random.default_rng(16)
    usual = random.uniform(0.0, 20.0, 50)
    ours = usual + 0.3 + random.normal(0.0, 0.2, 50)
    draws = [
        a_score(row="unit", chance=True, p95=each, usual=other)
        for each, other in zip(ours, usual, strict=True)
    ]
    unlucky = a_score(row="unit", chance=True, p95=11.39, usual=9.95)
    lucky = a_score(row="unit", chance=True, p95=0.24, usual=0.35)
    assert worse_rows([unlucky, lucky]) == []
    assert worse_rows([unlucky]) == []
    assert worse_rows(draws) == ["unit"]


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_fifty_draws_of_each_hold_what_the_report_promises() -> None:
    """Seeds nobody has seen: what fails says which it was.

    What is stated at 95 % may be off in a draw now and then: it is asked of a device's draws
    together. Everything else holds in each draw.
    """
    first = int(np.random.SeedSequence().generate_state(1)[0])
    found = {row: scores(row, 50, first) for row in ROWS}
    every = [one for each in found.values() for one in each]
    beyond = [
        (row, first + k, what)
        for row, each in found.items()
        for k, one in enumerate(each)
        for what in shortcomings(one)
        if not what.startswith(("not covered", "uncertainty wider"))
    ]
    assert not beyond
    assert {row: coverage(each) for row, each in found.items() if coverage(each) < 0.95} == {}
    widths = {
        row: float(np.median([one.width - one.lag for one in each if one.clean] or [0.0]))
        for row, each in found.items()
    }
    assert {row: width for row, width in widths.items() if width > 0.3} == {}
    assert not worse_rows(every)
    assert coverage(every) >= 0.99
    assert all(
        precision >= 0.95 and recall >= 0.95 for precision, recall in misnamed(every).values()
    )


def test_the_drawn_truth_is_none_of_what_is_received() -> None:
    """The emulation would be no test if truth could be read from it."""
    drawn = ROWS["steady, up to 400 ppm"](np.random.default_rng(3))
    assert np.abs(drawn.raw.stamps - drawn.truth).min() > 1.0
    lag = drawn.raw.arrival() - drawn.truth
    assert lag.min() > 0.0
