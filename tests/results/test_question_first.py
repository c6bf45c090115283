"""The test that a design was made for: first in the answer, and beside what it qualifies."""

import re
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.stats import f, ttest_ind

from labcrane.analysis.report.answer import _effects
from labcrane.analysis.report.factors import with_factors
from labcrane.analysis.report.findings import Results
from labcrane.analysis.report.words import STYLES, paragraphs
from results.test_conditions import crossover
from results.test_shortfalls import drawn, found

__all__ = ["found"]

Found = Callable[[pd.DataFrame], tuple[Results, str]]
TEST = r"F\((\d+), (\d+)\) = ([\d.]+), p [<=] (\.\d+)"


def trained(seed: int, gain: float) -> pd.DataFrame:
    """Return two groups in two sessions; the second group is faster by ``gain`` in the second."""
    table = drawn(seed, (6, 9))
    other = (table["group"] == "b") & (table["session"] == 2)
    return table.assign(movement_time=table["movement_time"] + 3.0 - gain * other)


def of_changes(table: pd.DataFrame, over: str) -> tuple[float, float]:
    """Return F and p of the groups' different changes, by SciPy's t test of them."""
    cells = table.groupby(["group", "participant", over])["movement_time"].mean().unstack(over)
    change = cells.iloc[:, 1] - cells.iloc[:, 0]
    names = sorted(table["group"].unique())
    t = ttest_ind(*(change[name] for name in names))
    return float(t.statistic) ** 2, float(t.pvalue)


def without_period(table: pd.DataFrame) -> tuple[float, float]:
    """Return F and p of the groups' different effects of a condition, by the orders' own columns.

    The change from one condition to the other is regressed on group and order, by NumPy.
    """
    cells = table.groupby(["participant", "condition"])["movement_time"].mean().unstack()
    change = (cells.iloc[:, 1] - cells.iloc[:, 0]).to_numpy()
    begins = table.sort_values("phase").drop_duplicates("participant").set_index("participant")
    begins = begins.loc[cells.index]
    first = begins["condition"] == cells.columns[0]
    group = begins["group"] == begins["group"].iloc[0]
    full = np.column_stack([np.ones(len(change)), 2.0 * group - 1.0, 2.0 * first - 1.0])

    def rest(model: np.ndarray) -> float:
        return float(np.linalg.lstsq(model, change, rcond=None)[1][0])

    free = len(change) - 3
    value = (rest(full[:, [0, 2]]) - rest(full)) / (rest(full) / free)
    return value, float(f.sf(value, 1, free))


def clauses(said: str) -> list[str]:
    """Return what is said of each effect."""
    return re.split(r"; (?=showed|differed|did not|the effect)", said)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("gain", [0.0, 1.5])
def test_groups_before_and_after_training_are_answered_by_their_interaction(
    found: Found, seed: int, gain: float
) -> None:
    table = trained(seed, gain)
    results, _ = found(table)
    (said,) = _effects(results)
    first, *others = clauses(said)
    f, p = of_changes(table, "session")
    beginning = "showed an interaction of" if p < 0.05 else "showed no detectable interaction of"
    assert f"{beginning} group and session (" in first
    df1, df2, printed, _ = re.search(TEST, first).groups()
    assert (df1, df2, float(printed)) == ("1", "13", pytest.approx(f, abs=0.006))
    means = table.groupby(["group", "session_name", "participant"])["movement_time"].mean()
    for (group, name), mean in means.groupby(level=[0, 1]).mean().items():
        number = 1 + (name == "retention")
        assert f"{group} {number} {name}: {mean:.3g} s" in first
    mains = {re.search(r"over (\w+)", one).group(1): one for one in others}
    for name, other in (("session", "group"), ("group", "session")):
        depends = f"on average: it depends on {other}"
        assert (depends in mains[name]) == (p < 0.05)
    (text,) = [one for one in paragraphs(results, STYLES["md"]) if one.startswith("Movement time")]
    assert clauses(text)[0].endswith(f"{beginning} group and session, *F*(1, 13) = " + (
        first.split(" = ", 1)[1].rstrip(")").replace("p ", "*p* ").replace("<", "&lt;")
        .replace("ηp²", "*η*<sub>p</sub>²")
    ))  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("effect", [0.0, 1.0])
def test_conditions_of_two_groups_are_answered_by_their_interaction(
    found: Found, effect: float
) -> None:
    table = crossover(3, 16, ("plain", "tone"))
    group = np.where(table["participant"].str[1:].astype(int) % 4 < 2, "old", "young")
    other = (group == "old") & (table["condition"] == "tone")
    table = table.assign(group=group, movement_time=table["movement_time"] + effect * other)
    table = table.assign(attempt=1, started=0.0, ended=9.0, movement_onset=0.3)
    results, _ = found(table.drop(columns=["phase", "of_session", "of_block", "place"]))
    (said,) = _effects(results)
    own = {
        re.search(r"(?:over|of) ([\w ]+?) \(", one).group(1): one
        for one in clauses(said)
        if " (" in one
    }
    assert list(own)[:2] == ["group and condition", "group and block"]
    expected, p = without_period(with_factors(table))
    *_, printed, _ = re.search(TEST, own["group and condition"]).groups()
    assert float(printed) == pytest.approx(expected, abs=0.006)
    assert ("on average: it depends on group" in own["condition"]) == (p < 0.05)
