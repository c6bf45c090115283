"""Effects that a design cannot tell apart: the report says so, and says of none more than it is."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.report.answer import _effects
from labcrane.analysis.report.findings import Results
from labcrane.analysis.report.words import STYLES, paragraphs
from labcrane.analysis.statistics.confounding import told_apart
from results.test_shortfalls import drawn, found, in_words

__all__ = ["found"]

Found = Callable[[pd.DataFrame], tuple[Results, str]]
TAKEN = "with pairs' means taken away"


def in_orders(seed: int, people: int, orders: int, sessions: int = 1) -> pd.DataFrame:
    """Return people who do their pairs in one of so many orders, the same in each session."""
    dice = np.random.default_rng([480, seed])
    table = drawn(seed, (people,), sessions)
    kinds = sorted(set(zip(table["distance"], table["far_side"], table["pair"], strict=True)))
    chosen = [dice.permutation(len(kinds)) for _ in range(orders)]
    number = table["participant"].str[1:].astype(int) % orders
    at = [chosen[who][place - 1] for who, place in zip(number, table["sequence"], strict=True)]
    for column, name in enumerate(("distance", "far_side", "pair")):
        table[name] = [kinds[one][column] for one in at]
    table["movement_time"] = np.exp(0.2 * table["distance"] + dice.normal(0.0, 0.3, len(table)))
    return table.assign(difficulty=table["distance"])


@pytest.mark.parametrize("seed", range(12))
def test_effects_can_be_told_apart_where_patsy_s_columns_have_the_rank(seed: int) -> None:
    from patsy import dmatrix

    dice = np.random.default_rng([481, seed])
    orders, people = int(dice.integers(1, 4)), int(dice.integers(3, 7))
    table = in_orders(seed, people, orders).sample(frac=0.8, random_state=seed)
    for factor, beside in (("sequence", "pair"), ("pair", "sequence"), ("distance", "sequence")):
        own = np.asarray(dmatrix(f"C({factor}) + C({beside}) + participant", table))
        without = np.asarray(dmatrix(f"C({beside}) + participant", table))
        added = np.linalg.matrix_rank(own) - np.linalg.matrix_rank(without)
        wanted = added == table[factor].nunique() - 1
        assert told_apart(table, [factor], [["participant"], [beside]]) == wanted, factor
        if orders == 1:
            assert not wanted


@pytest.mark.parametrize("seed", range(3))
def test_of_one_order_for_everybody_no_number_is_called_adjusted_or_an_effect_alone(
    found: Found, seed: int
) -> None:
    results, page = found(in_orders(seed, 6, orders=1))
    rows = results.table("anova").set_index("factor")["confounded"]
    assert rows["sequence"] == "pairs of targets"
    assert set(rows[["distance", "far_side", "distance:far_side"]]) == {"positions"}
    assert set(results.table("contrasts")["confounded"]) == {"positions"}
    assert set(results.table("trends")["confounded"]) == {"pairs of targets"}
    said = in_words(results)
    assert said.count(TAKEN) == 1
    assert (
        f"Not tested over sequence {TAKEN}: positions cannot be distinguished from pairs of" in said
    )
    assert "over sequence (cannot be distinguished from pairs of targets), F(" in said
    assert "over distance (cannot be distinguished from positions), F(" in said
    assert (
        "it "
        not in said.split("Over the positions of ")[1].split(" (cannot be distinguished from")[0]
    )
    assert ": not tested, positions cannot be distinguished from pairs of targets." in said
    assert "Pairs of targets come in several orders" not in page


@pytest.mark.parametrize("seed", range(3))
def test_the_answer_has_no_number_for_what_cannot_be_told_apart(found: Found, seed: int) -> None:
    table = in_orders(seed, 6, orders=1)
    results, _ = found(table)
    (said,) = _effects(results)
    assert "F(" not in said
    assert "the effect of sequence cannot be distinguished from pairs of targets" in said
    assert "the effect of distance cannot be distinguished from positions" in said


@pytest.mark.parametrize("seed", range(3))
def test_of_orders_of_ones_own_everything_is_told_apart_and_called_as_it_was_tested(
    found: Found, seed: int
) -> None:
    results, page = found(drawn(seed, (9,), sessions=1))
    assert set(results.table("anova")["confounded"]) == {""}
    said = in_words(results)
    assert "cannot be distinguished from" not in said + page
    assert f"over sequence {TAKEN}, F(" in said
    assert f"Change with each position of session 1, {TAKEN}:" in said.replace(
        "acquisition", "session 1"
    )
    assert "Pairs of targets come in several orders" in page


def test_of_one_pair_of_targets_nothing_is_called_adjusted(found: Found) -> None:
    table = drawn(4, (6,), sessions=1)
    results, page = found(table.assign(pair="2 left", distance=2.0, far_side="left"))
    assert "sequence" in set(results.table("anova")["factor"])
    assert not results.table("anova")["factor"].str.contains("taken away").any()
    assert TAKEN not in "".join(paragraphs(results, STYLES["html"]))
    assert "Pairs of targets come" not in page


def test_two_orders_that_mirror_each_other_tell_a_trend_and_not_each_position(
    found: Found,
) -> None:
    table = in_orders(5, 6, orders=1)
    other = table["participant"].str[1:].astype(int) % 2 == 1
    table["sequence"] = table["sequence"].mask(other, 7 - table["sequence"])
    assert not told_apart(table, ["sequence"], [["participant"], ["pair"]])
    results, _ = found(table)
    scales = results.table("time_scales").set_index("quantity")
    assert scales.loc["slope", "adjustment"] == TAKEN.removeprefix("with ")
    assert np.isfinite(scales.loc["slope", "t"])


@pytest.mark.parametrize("seed", range(3))
def test_a_factor_of_which_each_did_a_chance_part_is_said_not_to_be_tested(
    found: Found, seed: int
) -> None:
    """A block of two pairs of six in a drawn order, as ``block: {pairs: 2}`` makes it."""
    table = drawn(seed, (7,), sessions=1)
    part = table[table["sequence"] <= 2]
    had = part.groupby("participant")["distance"].nunique() == part["distance"].nunique()
    assert not had.any()
    results, page = found(part)
    said = in_words(results)
    assert "distance" not in set(results.table("anova")["factor"])
    for text in (said, page):
        assert "0 of 7 people have a value in every cell of distance, and 3 are needed" in text


def test_the_file_for_papers_says_the_same(found: Found, tmp_path: Path) -> None:
    found(in_orders(6, 5, orders=1))
    said = (tmp_path / "results.md").read_text(encoding="utf-8")
    assert "(cannot be distinguished from pairs of targets)" in said
