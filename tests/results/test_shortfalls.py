"""Planned tests that could not be made, or not of everybody: each is named, with why."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from labcrane.analysis.quality import is_result
from labcrane.analysis.questionnaires import SCORES
from labcrane.analysis.report.factors import with_factors
from labcrane.analysis.report.findings import Results
from labcrane.analysis.report.html import Page
from labcrane.analysis.report.report import _study
from labcrane.analysis.report.words import STYLES, paragraphs

PAIRS = [(distance, side) for distance in (2.0, 3.0, 6.0) for side in ("left", "right")]
NO_SCORES = pd.DataFrame(columns=list(SCORES))
UNITS = {"movement_time": "s", "absolute_error": "m"}


def drawn(seed: int, sizes: tuple[int, ...], sessions: int = 2) -> pd.DataFrame:
    """Return groups of these sizes, pairs in a drawn order, two movements each."""
    dice = np.random.default_rng(seed)
    people = [group for group, size in zip("abc", sizes, strict=False) for _ in range(size)]
    rows = [
        {
            "participant": f"P{person:03}",
            "group": group if len(sizes) > 1 else "",
            "session": session,
            "session_name": ("acquisition", "retention")[session - 1],
            "block": 1,
            "practice": 0.0,
            "attempt": 1,
            "sequence": place,
            "trial": 2 * place + number,
            "distance": PAIRS[at][0],
            "difficulty": PAIRS[at][0],
            "far_side": PAIRS[at][1],
            "pair": f"{PAIRS[at][0]:g} {PAIRS[at][1]}",
            "outcome": "success",
            "started": 0.0,
            "ended": 9.0,
            "movement_onset": 0.3,
            "movement_time": float(np.exp(0.2 * PAIRS[at][0] + dice.normal(0.0, 0.3))),
        }
        for person, group in enumerate(people, start=1)
        for session in range(1, sessions + 1)
        for place, at in enumerate(dice.permutation(len(PAIRS)), start=1)
        for number in (0, 1)
    ]
    return pd.DataFrame(rows)


def given_up(table: pd.DataFrame, where: "pd.Series[bool]") -> pd.DataFrame:
    return table.assign(
        outcome=table["outcome"].mask(where, "timeout"),
        movement_time=table["movement_time"].mask(where),
    )


@pytest.fixture
def found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[[pd.DataFrame], tuple[Results, str]]:
    """What the report says of movements, without its figures."""
    monkeypatch.setattr("labcrane.analysis.report.report._movements", lambda *_: None)
    monkeypatch.setattr("labcrane.analysis.report.report._mixed", lambda *_: None)

    def ask(table: pd.DataFrame) -> tuple[Results, str]:
        page = Page("drawn", tmp_path / "report.html", tmp_path)
        groups = dict(table.groupby("participant")["group"].first())
        results = _study(page, table, NO_SCORES, groups, "The sample.", (), UNITS)
        return results, page.write().read_text(encoding="utf-8")

    return ask


def whole(table: pd.DataFrame, cells: list[str]) -> int:
    """Return who has all cells, counted by hand."""
    own = with_factors(table)
    done = own[is_result(own)]
    planned = len(own.drop_duplicates(cells)) if cells else 1
    return sum(
        len(mine.drop_duplicates(cells)) == planned for _, mine in done.groupby("participant")
    )


def in_words(results: Results) -> str:
    (said,) = [
        text for text in paragraphs(results, STYLES["html"]) if text.startswith("Movement time")
    ]
    return said


@pytest.mark.parametrize("seed", range(3))
def test_a_factor_whose_cells_nobody_but_two_has_is_named_with_why(found, seed: int) -> None:
    dice = np.random.default_rng([420, seed])
    table = drawn(seed, (4, 5))
    people = sorted(table["participant"].unique())
    lacking = dice.choice(people, 7, replace=False)
    places = dict(zip(lacking, dice.integers(1, 7, 7), strict=True))
    gone = (table["session"] == 1) & (table["sequence"] == table["participant"].map(places))
    table = given_up(table, gone)
    results, page = found(table)
    assert whole(table, ["phase", "place"]) == 2
    assert "sequence" not in set(results.table("anova")["factor"])
    said = in_words(results)
    assert (
        "2 of 9 people have a value in every cell of session and sequence, and 3 are needed" in said
    )
    assert "Not tested over sequence" in said
    assert "2 of 9 people have a value in every cell of session and sequence" in page
    rows = results.shortfalls().set_index("factor")
    assert rows.loc["sequence", ["people", "whole"]].tolist() == [9, 2]
    assert "session" not in rows.index
    assert "group" not in rows.index


@pytest.mark.parametrize("seed", range(3))
def test_a_test_of_fewer_than_the_sample_tells_of_how_many(found, seed: int) -> None:
    dice = np.random.default_rng([421, seed])
    table = drawn(seed, (5, 7))
    one, other = dice.choice(sorted(table["participant"].unique()), 2, replace=False)
    gone = (table["participant"] == one) & (table["sequence"] == int(dice.integers(2, 6)))
    gone &= table["session"] == 2
    gone |= (table["participant"] == other) & (table["session"] == 2)
    results, _ = found(given_up(table, gone))
    assert set(results.shortfalls()["people"] - results.shortfalls()["whole"]) <= {1, 2}
    assert (results.shortfalls()["without"] != "").all()
    tests = results.table("anova").set_index("factor")
    assert tests["n"].min() == 10
    said = in_words(results)
    for name, n in tests["n"].items():
        if ":" not in name and "taken away" not in name:
            (sentence,) = [part for part in said.split("; ") if f" over {name}, F" in part]
            begin = sentence.split(". ")[0]
            assert f", n = {n} of 12 people" in begin + sentence
    assert "11 of 12 people" in said
    assert "10 of 12 people" in said
    by_hand = dict.fromkeys(results.table("contrasts")["factor"])
    for factor in by_hand:
        own = results.table("contrasts")[results.table("contrasts")["factor"] == factor]
        assert set(own["n"]) == {11}


def test_a_test_of_the_whole_sample_says_nothing_of_n(found) -> None:
    results, page = found(drawn(3, (5, 5)))
    assert " of 10 people" not in in_words(results)
    assert results.shortfalls().empty
    assert "Every planned test was made with all participants and levels." in page


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_group_that_lacks_a_session_is_named(found, seed: int) -> None:
    table = drawn(seed, (4, 5, 6))
    table = table[~((table["group"] == "b") & (table["session"] == 2))]
    results, _ = found(table)
    rows = results.shortfalls().set_index("factor")
    gone = "P005, P006, P007, P008 and P009"
    assert set(rows["without"]) == {"group b", gone}
    assert set(rows.loc[["session", "group"], "why"]) >= {"nothing recorded at session 2 retention"}
    rows = rows[rows["without"] == "group b"]
    assert {"session", "group", "sequence", "distance", "far_side"} <= set(rows.index)
    assert "distance:far_side" not in rows.index  # they have all of these
    assert (rows["whole"] == 0).all()
    assert (rows["people"] == 5).all()
    said = in_words(results)
    over = "session, group, sequence, sequence with pairs' means taken away, distance, far_side"
    why = "none of its 5 people has a value in every cell"
    assert f"Without group b, tested over {over}: {why}." in said


def test_a_level_that_nobody_reached_is_named_and_one_that_is_left_is_no_factor(found) -> None:
    table = drawn(5, (9,), sessions=1)
    results, _ = found(given_up(table, table["distance"] == 6.0))
    rows = results.shortfalls()
    own = rows[rows["factor"] == "distance"]
    assert own[["without", "why"]].to_numpy().tolist() == [
        ["distance 6", "no participant has a value there"]
    ]
    results, _ = found(given_up(table, table["far_side"] == "right"))
    said = in_words(results)
    assert (
        "Not tested over far_side, the interaction of distance and far_side: no participant has a "
        "value at far_side right." in said
    )


def test_where_nothing_can_be_tested_all_of_it_is_named_and_trends_too(found) -> None:
    results, page = found(drawn(6, (2,), sessions=2))
    assert results.table("anova").empty
    said = in_words(results)
    assert said.startswith(
        "Movement time, from onset to offset, was not tested by an analysis of variance."
    )
    rows = set(results.shortfalls()["factor"])
    assert rows == {
        "session", "sequence", "distance", "far_side", "distance:far_side",
        "linear trend of sequence in 1 acquisition", "linear trend of sequence in 2 retention",
    }  # fmt: skip
    assert "2 of 2 people have a value in every cell of session, and 3 are needed" in page
    assert "Mean change to 2 retention: not tested, 2 of 2 people have it, and 3 are" in said


def test_positions_that_cannot_be_told_from_pairs_are_named(found) -> None:
    table = drawn(7, (8,), sessions=1)
    table["pair"] = "pair " + table["sequence"].astype(str)
    results, _ = found(table)
    assert "positions cannot be distinguished from pairs of targets" in in_words(results)


@pytest.mark.parametrize("seed", range(3))
def test_of_practice_without_groups_only_those_are_missing_who_did_not_practise(
    found, seed: int
) -> None:
    table = drawn(seed, (6 + seed,), sessions=1)
    dice = np.random.default_rng([423, seed])
    away = set(dice.choice(sorted(table["participant"].unique()), seed, replace=False))
    practice = table[table["sequence"] <= 2].assign(practice=1.0, block=9)
    practice = practice[~practice["participant"].isin(away)]
    results, _ = found(pd.concat([table, practice], ignore_index=True))
    (test,) = results.tests("practice")
    assert set(results.factors.people) - set(test.people) == away
    rows = results.shortfalls()
    own = rows[rows["factor"] == "practice"] if len(rows) else rows
    assert set(" ".join(own.get("without", ())).replace(" and", "").split()) == away
    assert set(own.get("why", ())) <= {"nothing recorded at practice practice"}
