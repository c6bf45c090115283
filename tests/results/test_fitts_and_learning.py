"""Laws recover the parameters of operators who follow them."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import curve_fit

from labcrane.analysis import find_cohort, measures_of
from labcrane.analysis.statistics.fitts import (
    WIDTH_FACTOR,
    difficulty,
    mean_line,
    regress,
    throughput,
)
from labcrane.analysis.statistics.learning import CURVES, fit_curve, learning_curves
from results.recorded import STUDY, record, study

DISTANCES = np.repeat([2.0, 3.0, 4.0, 6.0], 8)


def test_difficulty_is_that_of_the_studys_geometry() -> None:
    bits = [difficulty(distance, 0.5) for distance in (2, 3, 4, 6)]
    assert bits == pytest.approx([2.322, 2.807, 3.170, 3.700], abs=5e-4)


def test_fitts_intervals_hold_the_true_parameters_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    bits = np.log2(DISTANCES / 0.5 + 1.0)
    slopes = intercepts = 0
    for _ in range(400):
        fit = regress(bits, 1.0 + 2.5 * bits + rng.normal(0.0, 0.8, len(bits)))
        assert fit is not None
        slopes += fit.slope_ci[0] <= 2.5 <= fit.slope_ci[1]
        intercepts += fit.intercept_ci[0] <= 1.0 <= fit.intercept_ci[1]
    # 95 % of 400 are 380; 362 is four standard deviations below.
    assert 362 <= slopes <= 397
    assert 362 <= intercepts <= 397


def test_a_line_through_nothing_is_not_drawn() -> None:
    assert regress(np.array([1.0, 2.0]), np.array([1.0, 2.0])) is None
    assert regress(np.ones(5), np.arange(5.0)) is None


def movements(n: int, spread: float, seed: int = 1) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    cells = [(person, distance) for person in ("P001", "P002") for distance in (2.0, 4.0)]
    frames = [
        pd.DataFrame(
            {
                "participant": participant,
                "distance": distance,
                "movement_time": 5.0,
                "amplitude": distance,
                "error_along": rng.normal(0.05, spread, n),
                "error_bound": np.nan,
            }
        )
        for participant, distance in cells
    ]
    return pd.concat(frames, ignore_index=True)


def test_throughput_is_the_mean_of_means_with_the_true_spread() -> None:
    table = throughput(movements(4000, spread=0.1))
    wide = WIDTH_FACTOR * 0.1
    expected = np.mean([math.log2(d / wide + 1.0) / 5.0 for d in (2.0, 4.0)])
    assert table["throughput"].to_numpy() == pytest.approx(expected, rel=0.01)
    assert set(table["pooled"]) == {"no"}


def test_throughput_is_of_each_distance_and_width_by_itself() -> None:
    slow = {0.3: 7.0, 0.8: 3.0}
    parts = [
        movements(4000, spread=width / WIDTH_FACTOR, seed=seed).assign(width=width, movement_time=s)
        for seed, (width, s) in enumerate(slow.items())
    ]
    bits = [math.log2(d / width + 1.0) / s for d in (2.0, 4.0) for width, s in slow.items()]
    found = throughput(pd.concat(parts, ignore_index=True))["throughput"].to_numpy()
    assert found == pytest.approx(np.mean(bits), rel=0.01)


def test_throughput_is_of_mean_times_so_that_their_scatter_does_not_raise_it() -> None:
    table = movements(4000, spread=0.1)
    even = throughput(table)["throughput"].to_numpy()
    scatter = np.random.default_rng(3).lognormal(0.0, 0.3, len(table))
    means = pd.Series(scatter).groupby([table["participant"], table["distance"]]).transform("mean")
    uneven = table.assign(movement_time=5.0 * scatter / means.to_numpy())
    assert throughput(uneven)["throughput"].to_numpy() == pytest.approx(even, rel=1e-9)


@pytest.mark.slow
def test_the_interval_of_the_mean_line_holds_peoples_true_mean_as_often_as_it_says() -> None:
    rng, held, runs = np.random.default_rng(4), 0, 200
    bits = np.repeat(np.log2(np.array([2.0, 3.0, 4.0, 6.0]) / 0.5 + 1.0), 8)
    for _ in range(runs):
        people = rng.normal((1.0, 2.5), (1.0, 0.6), (12, 2))
        lines = [regress(bits, a + b * bits + rng.normal(0.0, 0.5, 32)) for a, b in people]
        whole = mean_line([line for line in lines if line is not None])
        assert whole is not None
        assert whole.n == 12
        held += whole.slope_ci[0] <= 2.5 <= whole.slope_ci[1]
    assert 0.95 - 3.0 * math.sqrt(0.05 * 0.95 / runs) < held / runs < 0.99
    assert mean_line([]) is None


@pytest.mark.parametrize(("n", "pooled"), [(14, "participant"), (15, "no"), (4, "study")])
def test_few_ends_share_a_spread(n: int, pooled: str) -> None:
    table = throughput(movements(n, spread=0.1))
    assert set(table["pooled"]) == {pooled}
    assert np.isfinite(table["throughput"]).all()


@pytest.mark.parametrize("curve", ["exponential", "power"])
def test_a_learning_curve_without_noise_is_found_exactly(curve: str) -> None:
    n = np.arange(1.0, 9.0)
    fit = fit_curve(curve, n, CURVES[curve](n, 6.0, 4.0, 0.5))
    assert fit is not None
    assert (fit.asymptote, fit.gain, fit.rate) == pytest.approx((6.0, 4.0, 0.5), rel=1e-4)


def test_two_standard_errors_hold_the_true_rate_of_most_learners() -> None:
    rng = np.random.default_rng(4)
    n = np.arange(1.0, 33.0)
    inside = {"asymptote": 0, "gain": 0, "rate": 0}
    true = {"asymptote": 6.0, "gain": 4.0, "rate": 0.2}
    for _ in range(100):
        values = CURVES["exponential"](n, *true.values()) + rng.normal(0.0, 0.3, len(n))
        fit = fit_curve("exponential", n, values)
        assert fit is not None
        for name, value in true.items():
            error = abs(getattr(fit, name) - value)
            inside[name] += error <= 2.04 * getattr(fit, f"{name}_se")
    # 95 of 100 are expected; 86 is four standard deviations below.
    assert all(count >= 86 for count in inside.values()), inside


def test_the_better_curve_is_the_one_the_learner_follows() -> None:
    rng = np.random.default_rng(5)
    n = np.arange(1, 33)
    tables = []
    for name, curve in CURVES.items():
        for person in range(10):
            values = curve(n.astype(float), 6.0, 4.0, 0.6) + rng.normal(0.0, 0.1, len(n))
            tables.append(
                pd.DataFrame(
                    {"participant": f"{name}-{person}", "sequence": n, "movement_time": values}
                )
            )
    table = learning_curves(pd.concat(tables), "movement_time")
    better = table[table["better"] == "yes"]
    right = [
        who.startswith(curve)
        for who, curve in zip(better["participant"], better["curve"], strict=True)
    ]
    assert np.mean(right) >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize("curve", ["exponential", "power"])
def test_no_other_start_of_the_search_finds_a_curve_that_fits_better(curve: str) -> None:
    """Drawn learners, some of whom learn nothing: by curve_fit of scipy, from twelve starts."""
    rng = np.random.default_rng(24)
    for number in range(30):
        n = np.arange(1.0, rng.integers(6, 40))
        true = 5.0, rng.normal(0.0, 3.0) * (number % 3 > 0), 10.0 ** rng.uniform(-2.5, 0.8)
        y = CURVES[curve](n, *true) + rng.normal(0.0, 0.4, len(n))
        spread = np.ptp(y)
        bounds = (
            [y.min() - 2 * spread, -4 * spread, 1e-3],
            [y.max() + 2 * spread, 4 * spread, 10.0],
        )
        fit = fit_curve(curve, n, y)
        assert fit is not None
        ours = ((fit.at(n) - y) ** 2).sum()
        theirs = []
        for rate in np.geomspace(0.002, 9.0, 12):
            start = [y[-1], y[0] - y[-1], rate]
            found, _ = curve_fit(CURVES[curve], n, y, start, bounds=bounds, max_nfev=2000)
            theirs.append(((CURVES[curve](n, *found) - y) ** 2).sum())
        assert ours <= min(theirs) * (1.0 + 1e-5), (number, true)


def test_an_asymptote_that_data_do_not_show_is_not_identified() -> None:
    n = np.arange(1.0, 9.0)
    still_falling = fit_curve("exponential", n, 10.0 - 0.5 * n)
    assert still_falling is not None
    assert not still_falling.identified
    assert fit_curve("power", n[:3], n[:3]) is None


@pytest.mark.parametrize("curve", ["exponential", "power"])
def test_neither_flat_nor_linear_series_have_an_asymptote_and_no_time_is_negative(
    curve: str,
) -> None:
    rng, n = np.random.default_rng(38), np.arange(1.0, 9.0)
    flat = [fit_curve(curve, n, 5.0 + rng.normal(0.0, 0.5, 8)) for _ in range(100)]
    linear = [fit_curve(curve, n, 9.0 - 0.6 * n + rng.normal(0.0, 0.3, 8)) for _ in range(100)]
    fits = [fit for fit in [*flat, *linear] if fit is not None]
    assert len(fits) == 200
    assert sum(fit.identified for fit in fits[:100]) <= 5
    assert sum(fit.identified for fit in fits[100:]) <= 5
    assert min(fit.asymptote for fit in fits) >= 0.0


def test_a_curve_that_levels_off_is_identified_though_there_is_noise() -> None:
    rng, n = np.random.default_rng(39), np.arange(1.0, 9.0)
    fits = [
        fit_curve("exponential", n, 5.0 + 6.0 * np.exp(-0.8 * (n - 1)) + rng.normal(0.0, 0.2, 8))
        for _ in range(50)
    ]
    assert sum(fit is not None and fit.identified for fit in fits) >= 48


OPERATOR = (
    "operator: {use: simulated_operator, fitts_a_s: 3.0, fitts_b_s: 3.0, reaction_sd: 0, "
    "endpoint_noise: 0, motor_noise: 0, learning_gain: %s, learning_rate: 0.15}"
)


def simulated(folder: Path, gain: float) -> pd.DataFrame:
    """Return the movements of an operator without noise: one sub-movement each."""
    text = "\n".join(
        OPERATOR % gain if line.startswith("operator:") else line for line in STUDY.splitlines()
    ).replace("distances: [2, 3],", "distances: [2, 3, 4, 6],")
    record(study(folder, text), folder / "data", "P001")
    return measures_of(find_cohort(folder / "data").included[0])


@pytest.mark.slow
def test_fitts_law_of_a_simulated_operator_is_found_again(tmp_path: Path) -> None:
    """What is slower than 0.02 m/s at both ends of a minimum-jerk movement is not of its time."""
    table = simulated(tmp_path, gain=0.0)
    fit = regress(table["difficulty"].to_numpy(), table["movement_time"].to_numpy())
    assert fit is not None
    s = np.linspace(0.0, 0.5, 100_001)
    speed = 30.0 * s**2 * (1.0 - s) ** 2
    whole = 3.0 + 3.0 * table["difficulty"].to_numpy()
    slow = np.interp(0.02 * whole / table["distance"].to_numpy(), speed, s)
    expected = regress(table["difficulty"].to_numpy(), whole * (1.0 - 2.0 * slow))
    assert expected is not None
    assert fit.slope == pytest.approx(expected.slope, abs=0.02)
    assert fit.r2 > 0.9999


@pytest.mark.slow
def test_the_learning_rate_of_a_simulated_operator_is_found_again(tmp_path: Path) -> None:
    table = simulated(tmp_path, gain=0.5)
    practised = 3.0 + 3.0 * table["difficulty"]
    fit = fit_curve(
        "exponential",
        table["trial"].to_numpy(float),
        (table["movement_time"] / practised).to_numpy(),
    )
    assert fit is not None
    assert fit.identified
    assert abs(fit.rate - 0.15) <= 2.0 * fit.rate_se
    assert fit.rate_se < 0.02
