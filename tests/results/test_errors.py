"""Errors of aimed movements, by an independent model and by hand."""

import numpy as np
import pandas as pd
import pytest
from statsmodels.formula.api import ols

from labcrane.analysis.statistics.errors import errors


def drawn(seed: int) -> pd.DataFrame:
    """Return movements whose mean differs between conditions by more than within them."""
    random = np.random.default_rng(seed)
    rows = [
        {
            "participant": f"P{person:03}",
            "trial": number,
            "session": session,
            "distance": distance,
            "direction": way,
            "movement_time": 1.0,
            "constant_error": mean + random.normal(0.0, 0.036),
        }
        for person in (1, 2)
        for session in (1, 2)
        for distance in (2.0, 6.0)
        for way in ("outward", "inward")
        for mean in [random.normal(0.0, 0.1)]
        for number in range(int(random.integers(1, 12)))
    ]
    table = pd.DataFrame(rows)
    return table.assign(absolute_error=table["constant_error"].abs() + 0.02)


@pytest.mark.parametrize("seed", range(5))
def test_variable_error_is_the_residual_of_a_model_of_all_conditions(seed: int) -> None:
    table = drawn(seed)
    found = errors(table).set_index("participant")
    for person, own in table.groupby("participant"):
        model = ols("constant_error ~ C(session) * C(distance) * C(direction)", own).fit()
        assert found.loc[person, "variable_error_m"] == pytest.approx(np.sqrt(model.mse_resid))
        assert found.loc[person, "variable_error_m"] < 0.7 * np.std(own["constant_error"])


def test_absolute_error_is_along_the_axis_and_radial_error_in_any_direction() -> None:
    table = pd.DataFrame(
        {
            "participant": "P001",
            "trial": [1, 2, 3, 4],
            "distance": [2.0, 2.0, 4.0, 4.0],
            "movement_time": 1.0,
            "constant_error": [0.1, -0.1, 0.3, 0.3],
            "absolute_error": [0.2, 0.2, 0.5, 0.5],
        }
    )
    (row,) = errors(table).to_dict("records")
    assert row["constant_error_m"] == pytest.approx(0.15)
    assert row["absolute_error_along_m"] == pytest.approx(0.2)
    assert row["radial_error_m"] == pytest.approx(0.35)
    assert row["variable_error_m"] == pytest.approx(np.sqrt((0.02 + 0.0) / 2.0))


def test_one_movement_in_each_condition_has_no_variable_error() -> None:
    table = drawn(1).drop_duplicates(["participant", "session", "distance", "direction"])
    assert errors(table)["variable_error_m"].isna().all()
