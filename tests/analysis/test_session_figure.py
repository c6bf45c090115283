"""Picture of a session: its trials have the numbers that people read everywhere else."""

import pandas as pd

from labcrane.analysis.report.session_figure import names


def test_trials_are_counted_as_people_count_them_and_practice_apart() -> None:
    trials = pd.DataFrame(
        {
            "trial": [2, 4, 7, 8, 8, 11],
            "practice": [1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        }
    )
    assert names(trials) == ["practice 1", "practice 2", "1", "2", "2", "3"]
