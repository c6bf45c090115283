"""Load in the report: intervals and correlations against their formulas."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t

from labcrane.analysis.report.figures import load
from labcrane.analysis.tables.load import correlations, load_table


def movements() -> pd.DataFrame:
    rows = [
        {
            "participant": name,
            "condition": condition,
            "drt_hits": 2 if condition == "dual" else np.nan,
            "drt_misses": float(at == 0) if condition == "dual" else np.nan,
            "drt_hit_rate": 2 / 3 if condition == "dual" else np.nan,
            "drt_response_time": 0.4 + 0.1 * at if condition == "dual" else np.nan,
            "duty_cycle": 0.2 + 0.05 * at + 0.1 * (condition == "dual"),
        }
        for name in ("P001", "P002")
        for condition in ("alone", "dual")
        for at in range(4)
    ]
    return pd.DataFrame(rows)


def scores() -> pd.DataFrame:
    rows = [
        (name, condition, "nasa_tlx questionnaires 0.1.0", "raw", value)
        for name in ("P001", "P002")
        for condition, value in (("alone", 30.0), ("dual", 50.0))
    ]
    return pd.DataFrame(rows, columns=["participant", "condition", "version", "score", "value"])


def row_of(table: pd.DataFrame, measure: str, condition: str) -> pd.Series:
    at = (table["measure"] == measure) & (table["condition"] == condition)
    return table[at & (table["participant"] == "P001")].iloc[0]


def test_means_have_the_interval_of_their_movements() -> None:
    row = row_of(load_table(movements(), scores()), "drt_response_time", "dual")
    reach = t.ppf(0.975, 3) * np.std([0.4, 0.5, 0.6, 0.7], ddof=1) / 2
    assert (row["n"], row["mean"]) == (4, pytest.approx(0.55))
    assert row["ci_low"] == pytest.approx(0.55 - reach)


def test_a_hit_rate_is_of_all_stimuli_with_wilsons_interval() -> None:
    row = row_of(load_table(movements(), scores()), "drt_hit_rate", "dual")
    p, n, z = 8 / 9, 9, 1.959964
    middle, reach = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert (row["n"], row["mean"]) == (9, pytest.approx(p))
    assert row["ci_low"] == pytest.approx((middle - reach) / (1 + z**2 / n))
    assert row["ci_high"] == pytest.approx((middle + reach) / (1 + z**2 / n))


def test_a_questionnaire_asked_once_has_no_interval() -> None:
    table = load_table(movements(), scores())
    assert np.isnan(row_of(table, "TLX raw", "alone")["ci_low"])
    assert not set(table[table["condition"] == "alone"]["measure"]) & {"drt_hit_rate"}


def test_a_study_without_a_second_task_has_no_load() -> None:
    plain = movements()[["participant", "condition", "duty_cycle"]]
    assert load_table(plain, scores()).empty


def test_correlations_are_within_persons() -> None:
    # Persons differ widely and the other way round than conditions within them.
    random = np.random.default_rng(3)
    rows = []
    for person in range(6):
        for condition in "abcd":
            own = random.standard_normal()
            noise = 0.1 * random.standard_normal()
            for measure, value in (("x", own + 9 * person), ("y", own + noise - 9 * person)):
                rows.append((measure, f"P{person}", condition, value))
    table = pd.DataFrame(rows, columns=["measure", "participant", "condition", "mean"])
    (found,) = correlations(table).to_dict("records")
    wide = table.pivot_table("mean", ["participant", "condition"], "measure")
    own = wide - wide.groupby("participant").transform("mean")
    assert found["r"] == pytest.approx(np.corrcoef(own["x"], own["y"])[0, 1])
    assert (found["df"], found["participants"], found["cells"]) == (17, 6, 24)
    assert found["ci_low"] == pytest.approx(np.tanh(np.arctanh(found["r"]) - 1.96 / 4))


@pytest.mark.slow
def test_the_figure_has_a_row_for_each_person() -> None:
    figure = load(load_table(movements(), scores())).figure
    assert len(figure.axes) == 2 * 4


def test_a_result_of_a_plugin_that_is_called_so_is_no_detection_response_task() -> None:
    own = movements().rename(columns={"drt_hit_rate": "mine_hit_rate"})
    assert load_table(own, scores()).empty


def test_a_response_time_is_the_mean_of_hits_and_not_of_movements() -> None:
    own = movements()
    own["drt_hits"] = np.where(own.index % 2, 9.0, 1.0)
    own["drt_response_time"] = np.where(own.index % 2, 0.3, 1.3)
    dual = own[(own["condition"] == "dual") & (own["participant"] == own["participant"][0])]
    expected = (dual["drt_hits"] * dual["drt_response_time"]).sum() / dual["drt_hits"].sum()
    row = row_of(load_table(own, scores()), "drt_response_time", "dual")
    assert row["mean"] == pytest.approx(expected)
