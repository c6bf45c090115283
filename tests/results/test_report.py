"""The report, and the commands."""

import json
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from rehearsal import SHORT
from scipy.stats import ttest_rel

from labcrane.analysis import find_cohort, measures_of
from labcrane.analysis.cohort import Cohort, Status
from labcrane.analysis.measures import measures_of_trials
from labcrane.analysis.quality import exclusions, is_result, loop_quality, sync_quality
from labcrane.analysis.report import figures, report
from labcrane.analysis.report.factors import factors_of, with_factors
from labcrane.analysis.report.findings import Results, of_gaze_measures
from labcrane.analysis.report.html import Page
from labcrane.analysis.report.outcomes import StudyMovements, gaze_table, little_gaze, measures_in
from labcrane.analysis.report.report import write_report
from labcrane.analysis.report.sample import in_words, sample
from labcrane.analysis.report.words import STYLES, paragraphs
from labcrane.analysis.statistics.time_outs import time_outs
from labcrane.testing import main
from results import tested
from results.consumers import under
from results.synthetic import cohort_of_36


@pytest.fixture(scope="module")
def folder(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    struck = {"P006": (Status.ERASED, "on 2026-05-01: withdrew")}
    cohort = find_cohort(data, ["half-finished", "simulated"], struck=struck)
    out = tmp_path_factory.mktemp("report")
    done: list[int] = []
    page = write_report(cohort, out, progress=lambda number, of: done.append(number))
    assert page == out / "report.html"
    assert done == [1, 2, 3, 4]
    return out


@pytest.mark.slow
def test_each_figure_is_svg_png_and_pdf_stamped_where_it_is_of_no_people(folder: Path) -> None:
    files = under(folder)
    drawn = {path.removesuffix(".svg") for path in files if path.endswith(".svg")}
    assert {"figures/sequence_by_distance", "figures/fitts", "figures/sticks"} <= drawn
    for figure in drawn:
        assert (folder / f"{figure}.png").read_bytes().startswith(b"\x89PNG")
        assert (folder / f"{figure}.pdf").read_bytes().startswith(b"%PDF")
        ET.parse(folder / f"{figure}.svg")
        assert "<!-- SIMULATED -->" in (folder / f"{figure}.svg").read_text(encoding="utf-8")
        assert len(pd.read_csv(folder / f"{figure.replace('figures', 'tables')}.csv"))
    for name in ("results.md", "results.tex"):
        assert (folder / name).read_text(encoding="utf-8").startswith("SIMULATED.\n\n")


@pytest.mark.slow
def test_every_link_of_every_page_leads_somewhere(folder: Path) -> None:
    pages = [folder / "report.html", *sorted((folder / "participants").iterdir())]
    assert len(pages) == 5
    for page in pages:
        text = page.read_text(encoding="utf-8")
        targets = [
            part.split('"')[0] for key in ('href="', 'src="') for part in text.split(key)[1:]
        ]
        assert targets
        assert all((page.parent / target).is_file() for target in targets if target[0] != "#")


@pytest.mark.slow
def test_the_report_says_who_is_in_it_and_who_is_not(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "1 of 4 participants here are simulated." in page
    assert "1 of 4 participants here are half-finished." in page
    who = pd.read_csv(folder / "tables" / "participants.csv").set_index("participant")
    assert who.loc["P001-PILOT", "included"] == "no"
    assert who.loc["P006", "status"] == "erased"


@pytest.mark.slow
def test_figure_tables_hold_the_means_of_participants_means(folder: Path) -> None:
    movements = pd.read_csv(folder / "tables" / "movements.csv")
    table = pd.read_csv(folder / "tables" / "movement_time_by_sequence.csv").set_index("sequence")
    kept = movements[is_result(movements)]
    for sequence, own in kept.groupby("sequence"):
        means = [group["movement_time"].mean() for _, group in own.groupby("participant")]
        assert table.loc[sequence, "mean"] == pytest.approx(np.mean(means))
        assert table.loc[sequence, "participants"] == len(means)


def test_the_sample_in_words_says_of_how_many_an_answer_is_known() -> None:
    ages, genders = [20.0, 30.0, np.nan, 25.0], ["female", "", "female", "male"]
    answers = pd.DataFrame(
        [(f"P{n}", "age", age, "") for n, age in enumerate(ages)]
        + [(f"P{n}", "gender", np.nan, word) for n, word in enumerate(genders)],
        columns=["participant", "item", "value", "text"],
    )
    groups = {f"P{n}": "" for n in range(5)}  # one was asked nothing
    table = sample(answers, groups)
    assert in_words(table) == (
        "5 participants (2 female, 1 male and 2 without an answer; "
        "20 to 30 years old, M = 25.00, SD = 5.00, of 3 who said it)."
    )
    assert table.loc[0, "gender_answers"] == table.loc[0, "age_answers"] == 3


@pytest.mark.slow
def test_areas_looked_at_are_told_of_fewer_people_too_than_a_test_needs(folder: Path) -> None:
    movements = pd.read_csv(folder / "tables" / "movements.csv")
    kept = movements[is_result(movements)]
    assert kept.dropna(subset=["dwell_during_1"])["participant"].nunique() == 2
    looked = pd.read_csv(folder / "tables" / "gaze.csv").set_index("distance")
    valid = ("gaze_valid_before", "gaze_valid_during")
    for name in ("dwell_before_1", "dwell_during_1", "look_lead_1", *valid):
        for distance, own in kept.groupby("distance"):
            means = own.groupby("participant")[name].mean().dropna()
            assert looked.loc[distance, name] == pytest.approx(np.mean(list(means)))
    assert ">Gaze</h2>" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("seed", range(3))
def test_looks_are_an_outcome_that_is_tested_and_put_into_words(seed: int) -> None:
    """Two distances are a paired difference, and F is the square of its t."""
    random = np.random.default_rng(seed)
    rows = [
        {"participant": f"P{person:03}", "sequence": place, "distance": distance,
         "dwell_during_grapple": random.normal(0.2 * distance, 0.3), "outcome": "success"}
        for person in range(8) for place, distance in enumerate([2.0, 4.0, 2.0, 4.0])
    ]  # fmt: skip
    table = with_factors(pd.DataFrame(rows))
    factors = factors_of(table)
    findings = list(of_gaze_measures(StudyMovements(table, table, factors)))
    results = Results("", tested.COUNTS, factors, findings)
    tests = results.table("gaze_tests")
    cells = table.groupby(["participant", "distance"])["dwell_during_grapple"].mean().unstack()
    t, p = ttest_rel(cells[2.0], cells[4.0])
    (row,) = tests.to_dict("records")
    assert (row["measure"], row["factor"]) == ("dwell_during_grapple", "distance")
    assert (row["df1"], row["df2"], row["epsilon"]) == (1, 7, 1.0)
    assert [row["f"], row["p_gg"]] == pytest.approx([t**2, p])
    said = paragraphs(results, STYLES["html"])[-1]
    verb = "differed" if p < 0.05 else "did not detectably differ"
    begin = f"How long grapple was looked at during movements {verb} over distance"
    assert said.startswith(f"{begin}, F(1, 7) = {t**2:.2f}, p ")


def test_time_outs_are_told_by_condition_with_a_median_in_which_they_take_longer() -> None:
    """Of what is easy all is done; of what is hard 3 of 5, and of what is hardest 1 of 5."""
    done = {2.0: [1, 2, 3, 4, 5], 4.0: [2, 3, 9], 6.0: [4]}
    rows = [
        {"participant": "P001", "practice": 0, "distance": distance, "started": 0.0,
         "outcome": "success" if number < len(seconds) else "timeout",
         "ended": float(seconds[number]) if number < len(seconds) else 10.0}
        for distance, seconds in done.items() for number in range(5)
    ]  # fmt: skip
    counts = time_outs(pd.DataFrame(rows), ["distance"])
    factors = factors_of(with_factors(pd.DataFrame(rows).assign(sequence=1)))
    results = Results("", counts, factors)
    (said,) = paragraphs(results, STYLES["html"])
    assert said.strip() == (
        "Of 15 trials, 6 (40.0 %) ended by time-out. Means of successes alone look fast; in the "
        "medians time-outs are censored at the limit: "
        "4 m: 2 of 5, mean of successes 4.67 s, median 9 s; "
        "6 m: 4 of 5, mean of successes 4 s, over half given up."
    )
    (said,) = paragraphs(results, STYLES["tex"])
    assert r"6 (40.0 \%) ended" in said


@pytest.mark.parametrize("seed", range(5))
def test_trials_that_needed_several_attempts_count_as_one_trial(seed: int) -> None:
    random = np.random.default_rng(seed)
    planned = int(random.integers(5, 40))
    rows = []
    for trial in range(planned):
        cut = random.choice(["repeated", "ended", "interrupted"], random.integers(0, 4)).tolist()
        ended = str(random.choice(["success", "timeout", "skipped", "failure"]))
        rows += [
            {"participant": "P001", "practice": 0, "distance": 2.0, "trial": trial,
             "attempt": attempt, "outcome": outcome, "started": 0.0, "ended": 4.0}
            for attempt, outcome in enumerate([*cut, ended], 1)
        ]  # fmt: skip
    [counts] = time_outs(pd.DataFrame(rows), ["distance"]).to_dict("records")
    last = [row["outcome"] for row, after in pairwise([*rows, {"attempt": 1}])
            if after["attempt"] == 1]  # fmt: skip
    assert counts["trials"] == planned
    assert counts["successes"] == last.count("success")
    assert counts["time_outs"] == last.count("timeout")
    assert counts["others"] == planned - last.count("success") - last.count("timeout")


def test_a_mean_of_two_people_has_no_bar_in_figures_and_its_interval_in_the_table() -> None:
    """Theirs is thirteen times as wide as they are apart, and fills whatever is drawn."""
    random = np.random.default_rng(5)
    rows = [
        {"participant": f"P{person:03}", "distance": 2.0 if person < 2 else 4.0, "sequence": place,
         "movement_time": random.uniform(2.0, 5.0)}
        for person in range(5) for place in (1, 2, 3)
    ]  # fmt: skip
    drawing = figures.by_distance(pd.DataFrame(rows))
    (axes,) = drawing.figure.axes
    two, three = (
        np.ptp([bar[:, 1] for bar in bars.get_segments()], axis=1) for bars in axes.collections
    )
    assert (two == 0.0).all()
    own = drawing.table[drawing.table["distance"] == 4.0]
    assert three == pytest.approx((own["ci_high"] - own["ci_low"]).to_numpy())
    assert (three > 0.0).all()
    few = drawing.table[drawing.table["distance"] == 2.0]
    assert (few["ci_high"] > few["mean"]).all()
    assert "for three or more participants" in drawing.caption


def test_means_of_dwell_say_how_much_of_gaze_is_known_and_how_many_movements_lost_half() -> None:
    random = np.random.default_rng(462)
    rows = [
        {"participant": f"P{person:03}", "sequence": place, "distance": distance,
         "outcome": "success", "dwell_during_grapple": 0.1,
         "gaze_valid_before": random.uniform(0.0, 1.0),
         "gaze_valid_during": random.choice([np.nan, 0.0, 0.49, 0.5, 1.0])}
        for person in range(5) for place, distance in enumerate([2.0, 4.0, 2.0, 4.0])
    ]  # fmt: skip
    table = with_factors(pd.DataFrame(rows))
    few = [row["gaze_valid_before"] < 0.5 or row["gaze_valid_during"] < 0.5 for row in rows]
    assert 0 < sum(few) < len(rows)
    assert little_gaze(table) == sum(few)
    shown = gaze_table(table, factors_of(table)).set_index("distance")
    for distance in (2.0, 4.0):
        own = [row["gaze_valid_before"] for row in rows if row["distance"] == distance]
        assert shown.loc[distance, "gaze_valid_before"] == pytest.approx(np.mean(own))
    assert little_gaze(table.drop(columns=["gaze_valid_before", "gaze_valid_during"])) == 0


@pytest.mark.slow
def test_trials_that_are_no_results_are_listed_with_the_reason(data: Path) -> None:
    cohort = find_cohort(data, ["half-finished"])
    ended = cohort.included[2]
    measures = measures_of(ended)
    out = exclusions(measures)
    assert set(out["why"]) == {"outcome ended"}
    assert len(out) + is_result(measures).sum() == len(measures)


def test_practice_is_no_result() -> None:
    table = pd.DataFrame(
        {
            "participant": "P001",
            "session": 1,
            "trial": [1, 2, 3],
            "attempt": 1,
            "outcome": ["success", "timeout", "success"],
            "practice": [1.0, 0.0, 0.0],
        }
    )
    assert is_result(table).tolist() == [False, False, True]
    assert exclusions(table)["why"].tolist() == ["practice", "outcome timeout"]


def one_that_never_moved() -> pd.DataFrame:
    """Return the movements of 36 people, of whom P003's trial 17 was over before anything moved."""
    table = cohort_of_36().assign(movement_onset=0.4, error=lambda t: t["absolute_error"])
    table = table.assign(outcome="success", practice=0.0, session=1.0, attempt=1.0, block=1.0)
    table = table.assign(pair=table["distance"].astype(str) + table["far_side"])
    never = (table["participant"] == "P003") & (table["trial"] == 17)
    table.loc[never, ["movement_onset", "movement_time"]] = np.nan
    table.loc[never, ["error", "error_along"]] = 3.64, -3.64
    return table.drop(columns=["sequence", "absolute_error"])


def test_a_movement_without_an_onset_is_no_result_and_no_accuracy_and_is_listed() -> None:
    table = one_that_never_moved()
    measured = measures_of_trials(table)
    out = exclusions(measured)
    assert out[["participant", "trial", "why"]].to_numpy().tolist() == [
        ["P003", 17, "outcome success, no onset"]
    ]
    missing = measured["absolute_error"].isna()
    assert missing.sum() == measured["constant_error"].isna().sum() == 1
    assert (missing == ~is_result(measured)).all()
    assert measured.loc[missing, "error"].tolist() == [3.64]  # as it was recorded
    given_up = table.assign(outcome="timeout")
    assert set(exclusions(given_up)["why"]) == {"outcome timeout", "outcome timeout, no onset"}
    other = table.drop(columns="error_along")  # a task whose trials are no aimed movements
    assert is_result(other).all()


@pytest.mark.slow
def test_a_movement_without_an_onset_is_named_in_the_report(cohort: Cohort, tmp_path: Path) -> None:
    measured = measures_of_trials(one_that_never_moved())
    page = Page("A study", tmp_path / "report.html", tmp_path)
    report._who(page, cohort, measured)
    said = page.write().read_text(encoding="utf-8")
    assert "In P003 trial 17 the movement has no onset" in said
    (row,) = pd.read_csv(tmp_path / "tables" / "without_onset.csv").to_dict("records")
    assert (row["participant"], row["trial"], row["outcome"]) == ("P003", 17, "success")
    assert row["error"] == 3.64
    counts = time_outs(measured.assign(started=0.0, ended=3.0), ["distance"])
    assert counts[["successes", "others"]].sum().tolist() == [len(measured) - 1, 1]


def test_a_time_to_rest_is_an_outcome_of_its_own_where_taps_end_movements() -> None:
    table = cohort_of_36()
    assert "onset_to_rest" not in measures_in(table)
    by_rest = table.assign(onset_to_rest=table["movement_time"], at_rest=0.2)
    assert measures_in(by_rest) == measures_in(table)  # the same numbers are no second outcome
    by_tap = by_rest.assign(onset_to_rest=by_rest["movement_time"] - 0.4, at_rest=0.4)
    assert measures_in(by_tap) == [*measures_in(table), "onset_to_rest"]
    assert report._rests(by_tap).endswith("Every movement has it.")
    by_tap.loc[:4, ["onset_to_rest", "at_rest"]] = np.nan, 0.0
    by_tap.loc[5:6, ["onset_to_rest", "at_rest"]] = np.nan, 0.1
    assert report._rests(by_tap).endswith(
        "7 of 1152 movements have none: in 5 the tip still moved when they were ended, in 2 it had "
        "not rested long enough."
    )


@pytest.mark.slow
def test_quality_is_that_of_the_record(cohort: Cohort) -> None:
    loop = loop_quality(cohort.included[0]).iloc[0]
    assert (loop["late_ticks"], loop["lateness_worst_ms"], loop["rate_hz"]) == (0, 0.0, 120.0)
    assert loop["sync_verdict"] == cohort.included[0].recording.session(1).sync_report["verdict"]
    sync = sync_quality(cohort.included[0]).iloc[0]
    assert (sync["stream"], sync["corrected"]) == ("eyes", "yes")
    assert sync["samples"] > 1000


@pytest.mark.slow
def test_a_rehearsal_fails_in_nothing_that_is_not_there(tmp_path: Path) -> None:
    """A study with a required EEG, simulated: FAIL is kept for what failed."""
    streams = (
        "streams: {eeg: {type: EEG, name: amp}, gaze: {name: eyes, required: false}}\nsessions:"
    )
    path = tmp_path / "study.yaml"
    path.write_text(SHORT.replace("sessions:", streams), encoding="utf-8")
    out = tmp_path / "data"
    assert main(["simulate", str(path), "--participants", "1", "--out", str(out)]) == 0
    (person,) = find_cohort(out, ["simulated"]).included
    report = person.recording.session(1).sync_report
    assert (report["verdict"], report["missing"], report["absent"]) == ("PASS", [], ["eeg", "gaze"])
    row = loop_quality(person).iloc[0]
    assert (row["sync_verdict"], row["not_there"]) == ("PASS", "eeg, gaze")


@pytest.mark.slow
@pytest.mark.parametrize("to", ["tables", "matlab", "bids", "psychds", "xdf"])
def test_export_writes_what_is_asked_for_and_who_was_left_out(
    data: Path, tmp_path: Path, to: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["export", str(data), "--to", to, "--out", str(out)]) == 3  # P007 is a wreck
    said = capsys.readouterr().out
    assert "left out: P003, half-finished: session 1 ended by order; to continue it" in said
    assert "2/2" in said
    about = json.loads((out / ".labcrane" / "labcrane_export.json").read_text(encoding="utf-8"))
    assert about["format"] == to
    assert sum(person["included"] == "yes" for person in about["participants"]) == 2
    assert main(["export", str(data), "--to", to, "--out", str(out)]) == 2
    assert "is not empty, and nothing is overwritten" in capsys.readouterr().err


@pytest.mark.slow
def test_wrong_words_are_refused(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    assert main(["export", str(data), "--to", "table", "--out", out]) == 1
    assert "exporter 'table' is not installed; did you mean 'tables'?" in capsys.readouterr().err
    assert main(["export", str(data), "--to", "tables", "--out", out, "--set", "streams=xls"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "; write --set NAME=VALUE, where tables has streams" in said
    assert "tables.streams is " in said
    assert main(["export", str(data), "--to", "bids", "--out", out, "--set", "every"]) == 2
    assert "--set 'every' is not an assignment; write NAME=VALUE" in capsys.readouterr().err
