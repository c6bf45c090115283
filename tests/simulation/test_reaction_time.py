"""Reaction time of operators on whom distance has no effect."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f_oneway
from simulation.test_crane_pilot import simulated_pilot

from labcrane.analysis import find_cohort, movements_of


def p_over_distance(table: pd.DataFrame, measure: str) -> float:
    """Return p of an effect of distance on the log of a measure, people's means taken away."""
    own = np.log(table[measure])
    own = own - own.groupby(table["who"]).transform("mean")
    return float(f_oneway(*(part for _, part in own.groupby(table["distance"]))).pvalue)


@pytest.mark.slow
def test_reaction_time_of_an_operator_without_an_effect_does_not_go_with_distance(
    tmp_path: Path,
) -> None:
    """A share of the peak speed, by which it once was measured, finds one in the same movements."""
    out = simulated_pilot(tmp_path, 4)
    rows = [
        {
            "who": person.name,
            "distance": movement.result("distance"),
            "reaction_time": movement.result("reaction_time"),
            "share_of_peak": movement.elapsed[
                np.argmax(movement.speed > 0.05 * movement.speed.max())
            ],
        }
        for person in find_cohort(out, ["simulated"]).included
        for _, session in person.sessions()
        for movement in movements_of(session)
    ]
    table = pd.DataFrame(rows)
    assert len(table) == 128
    assert p_over_distance(table, "reaction_time") > 0.05
    assert p_over_distance(table, "share_of_peak") < 1e-4
    # The operator's median of 0.35 s, and two ticks of seeing and doing.
    assert table["reaction_time"].median() == pytest.approx(0.35 + 1.5 / 60.0, abs=0.03)
