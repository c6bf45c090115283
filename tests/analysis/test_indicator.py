"""The performance indicator against its published test vectors, and LibreOffice's totals."""

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from needs import need
from programs import ran

from labcrane import LabcraneError, RecordingError, open_recording
from labcrane.analysis import find_cohort
from labcrane.analysis.advice import familiarity, fatigue, suggest
from labcrane.analysis.report.workbook import advice, write_workbook
from labcrane.analysis.scoring.indicator import Indicator, Performance, indicate
from labcrane.analysis.scoring.operator_tests import (
    Detection,
    OperatorTest,
    completion,
    operator_tests,
)
from labcrane.analysis.scoring.settings import IndicatorSettings, Weights
from labcrane.cli.commands.results import LEFT_OUT
from labcrane.core import Event
from labcrane.participants.enrolment import exclude
from labcrane.participants.folders import Places
from labcrane.participants.register import Entry, changed
from labcrane.recording.journal import Column, SessionJournal
from labcrane.recording.participant_file.writer import consolidate
from labcrane.testing import main

LITERAL = IndicatorSettings()
UNCAPPED = IndicatorSettings(capped=False)
SHARED = IndicatorSettings(reading="shared_overloads")


def points(
    time: float,
    counts: tuple[int, int, int, int] = (0, 0, 0, 0),
    ratings: tuple[float, float] = (1.0, 1.0),
    *,
    k: bool = True,
    settings: IndicatorSettings = LITERAL,
) -> Indicator:
    return indicate(Performance(60.0 * time, *counts, *ratings, completed=k), 60.0, settings)


VECTORS = [
    (1.00, (0, 0, 0, 0), (1.0, 1.0), True, 120.0, 100.0, 120.0),
    (0.80, (0, 0, 0, 0), (1.0, 1.0), True, 120.0, 100.0, 125.0),
    (1.25, (1, 0, 2, 1), (0.7, 0.6), True, 89.0, 74.167, 89.0),
    (2.00, (4, 4, 4, 4), (0.0, 0.0), True, 10.0, 8.333, 10.0),
    (1.25, (5, 0, 0, 0), (0.7, 0.6), False, 0.0, 0.0, 0.0),
    (1.25, (6, 0, 0, 0), (0.5, 0.5), True, 86.0, 71.667, 86.0),
]


@pytest.mark.parametrize(("time", "counts", "ratings", "k", "raw", "percent", "uncapped"), VECTORS)
def test_the_six_vectors(
    time: float,
    counts: tuple[int, int, int, int],
    ratings: tuple[float, float],
    *,
    k: bool,
    raw: float,
    percent: float,
    uncapped: float,
) -> None:
    found = points(time, counts, ratings, k=k)
    assert found.raw == pytest.approx(raw, abs=1e-12)
    assert round(found.percent, 3) == percent
    free = points(time, counts, ratings, k=k, settings=UNCAPPED)
    assert free.raw == pytest.approx(uncapped, abs=1e-12)


def test_a_shared_overload_component_makes_a_hundred_points() -> None:
    assert points(1.0, settings=SHARED).raw == 100.0
    # max(0, 1 - (3 + 3) / 4) is 0, where two components would keep 5 points each.
    assert points(1.0, (0, 0, 3, 3), settings=SHARED).raw == 80.0
    assert points(1.0, (0, 0, 3, 3)).raw == 90.0


def test_a_missing_rating_is_not_made_up() -> None:
    found = points(1.0, ratings=(math.nan, 1.0))
    assert math.isnan(found.raw)
    assert found.objective == 100.0


def test_a_test_that_was_not_completed_has_no_points_though_a_rating_is_missing() -> None:
    found = points(1.0, ratings=(math.nan, 1.0), k=False)
    assert (found.raw, found.percent) == (0.0, 0.0)
    assert math.isnan(found.subjective)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({"body": -1.0}, "greater than or equal to 0"),
        (dict.fromkeys(Weights.model_fields, 0.0), "all weights are 0"),
    ],
)
def test_weights_below_zero_or_all_zero_are_refused(
    weights: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Weights(**weights)


@pytest.mark.parametrize(
    ("test", "message"),
    [
        (Performance(0.0, 0, 0, 0, 0, 1.0, 1.0, completed=True), "the test took 0.0 s"),
        (Performance(9.0, -1, 0, 0, 0, 1.0, 1.0, completed=True), "object counts -1"),
        (Performance(9.0, 0, 0, 0, 0, 7.0, 1.0, completed=True), "accuracy is 7.0; it must be 0"),
    ],
)
def test_what_cannot_be_is_refused(test: Performance, message: str) -> None:
    with pytest.raises(LabcraneError, match=message):
        indicate(test, 60.0, LITERAL)


@pytest.mark.parametrize(
    ("flag", "worst", "overruled", "outcome", "k"),
    [
        (math.nan, 4, False, "success", True),
        (math.nan, 5, False, "success", False),
        (math.nan, 6, True, "success", True),
        (math.nan, 0, False, "timeout", False),
        (1.0, 5, False, "failure", True),
        (0.0, 0, False, "success", False),
    ],
)
def test_five_mistakes_end_a_test_unless_the_supervisor_says_otherwise(
    flag: float, worst: int, outcome: str, *, overruled: bool, k: bool
) -> None:
    row = {"completion": flag, "outcome": outcome}
    assert completion(row, worst, LITERAL, overruled=overruled)[0] is k


ROW = {
    "block": 1, "block_name": "doors", "practice": False, "counted": True, "attempt": 1,
    "outcome": "success", "completion": None,
}  # fmt: skip


def record(
    folder: Path,
    operator: str,
    rows: list[dict],
    *,
    session: int = 1,
    ratings: bool = True,
    more: Sequence[tuple[str, float, dict]] = (),
    views: Sequence[str] = (),
) -> None:
    """Record trials as a scenario task would, ratings after each, as a session writes them.

    ``views`` are of the operator, and show nothing.
    """
    home = folder / operator
    home.mkdir(parents=True, exist_ok=True)
    path = home / f"ses-{session:02}_run.xdf"
    about = {
        "participant": operator, "study": "rescue", "indicator": LITERAL.model_dump(),
        "rate_hz": 240.0,
        "simulated": operator.endswith("-SIMULATED"),
        "components": {f"views.{name}": {"use": "view", "settings": {}} for name in views},
    }  # fmt: skip
    loop = [
        Column("loop", name, unit) for name, unit in (("tick", "1"), ("due", "s"), ("paused", "1"))
    ]
    columns = [*loop, Column("state", "joint.angle.boom", "rad")]
    with SessionJournal(path, columns, 240.0) as journal:
        journal.write_event(Event("session.start", 1.0, about), 0)
        for name in views:
            journal.write_event(Event("feedback.ready", 1.0, {"what": name, "facts": ""}), 0)
        for tick, due in enumerate((1.0, 1.0 + 10.0 * len(rows))):
            journal.write_frame(due, np.array([tick, due, 0.0, 0.0]))
        for at, row in enumerate(rows, start=1):
            edges = {"started": 10.0 * at - 8.0, "ended": 10.0 * at, "paused": 0.0}
            data = {**ROW, "trial": at, **edges, **row}
            rating = data.pop("ratings", (0.7, 0.6))
            journal.write_event(Event("trial.end", 10.0 * at, data), at)
            names = ("subjective_accuracy", "situational_awareness")
            for name, share in zip(names, rating, strict=True):
                done = {"questionnaire": name, "step": at, "score.share": share, "missing": 0}
                if ratings:
                    journal.write_event(Event("questionnaire.end", 10.0 * at + 1, done), at)
        for name, time, data in more:
            journal.write_event(Event(name, time, {**data, "refused": None}), len(rows))
    consolidate(home / f"{operator}.h5", [path])


def scored(folder: Path) -> list[OperatorTest]:
    return operator_tests(find_cohort(folder, ["half-finished"]))


def trial(time: float, counts: tuple[int, int, int, int] = (0, 0, 0, 0), **more: object) -> dict:
    names = ("n_object", "n_body", "n_overload_max", "n_overload_min")
    return {"time": time, **dict(zip(names, counts, strict=True)), **more}


def vectors() -> list[dict]:
    reference = trial(60.0, reference=True)
    tests = [
        trial(60.0 * time, counts, ratings=ratings, completion=int(k))
        for time, counts, ratings, k, *_ in VECTORS
    ]
    return [reference, *tests]


def test_the_vectors_come_out_of_recordings_too(tmp_path: Path) -> None:
    record(tmp_path, "R001", vectors())
    tests = scored(tmp_path)
    assert [test.indicator.raw for test in tests] == pytest.approx([v[4] for v in VECTORS])
    assert {test.reference_s for test in tests} == {60.0}
    assert {test.scenario for test in tests} == {"doors"}


def test_every_operator_needs_a_reference_stage(tmp_path: Path) -> None:
    record(tmp_path, "R001", [trial(60.0, reference=True, outcome="timeout"), trial(70.0)])
    with pytest.raises(RecordingError, match="R001 has no reference stage that was completed"):
        scored(tmp_path)


def test_each_scenario_has_its_own_reference_and_a_slow_one_can_score(tmp_path: Path) -> None:
    """Six scenes of very different length; each test takes 30 % longer than its reference."""
    times = {"touch": 20.0, "carry": 55.0, "lift": 90.0, "reach": 140.0, "pull": 33.0, "over": 71.0}
    references = [trial(t, reference=True, scenario=name) for name, t in times.items()]
    tests = [trial(1.3 * t, scenario=name, completion=1) for name, t in times.items()]
    record(tmp_path, "R001", references + tests)
    found = scored(tmp_path)
    assert {test.scenario: test.reference_s for test in found} == times
    for test in found:
        assert test.indicator.points["duration"] == pytest.approx(20.0 / 1.3)


def test_one_without_a_reference_is_named_and_the_others_are_scored(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path, "R001", [trial(60.0), trial(70.0)])
    record(tmp_path, "R002", [trial(60.0, reference=True), trial(70.0)])
    touched = [trial(50.0, reference=True, scenario="touch"), trial(60.0, scenario="touch")]
    record(tmp_path, "R003", [*touched, trial(60.0, scenario="carry")])
    assert main(["score", str(tmp_path)]) == 3
    said = " ".join(capsys.readouterr().out.split())
    assert "left out: R001 has no reference stage that was completed before 2 of the tests" in said
    assert (
        "left out: R003 has no reference stage of 'carry' (1) that was completed before 1 of"
    ) in said
    with (tmp_path / "evaluation.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["operator"] for row in rows] == ["R002", "R003"]


def test_totals_are_values_for_pandas_with_formulas_beside_them_and_a_csv_twin(
    tmp_path: Path,
) -> None:
    import pandas as pd

    record(tmp_path, "R001", vectors())
    assert main(["score", str(tmp_path)]) == 0
    tests = scored(tmp_path)
    sheet = pd.read_excel(tmp_path / "evaluation.xlsx", sheet_name="Tests")
    twin = pd.read_csv(tmp_path / "evaluation.csv")
    for name in ("raw", "percent", "objective", "subjective"):
        expected = [getattr(test.indicator, name) for test in tests]
        assert sheet[name].to_numpy() == pytest.approx(expected)
        assert twin[name].to_numpy() == pytest.approx(expected)
    assert not any("formula" in name for name in twin)
    means = pd.read_excel(tmp_path / "evaluation.xlsx", sheet_name="Summary")
    assert means["percent"].item() == pytest.approx(sheet["percent"].mean())
    trend = pd.read_excel(tmp_path / "evaluation.xlsx", sheet_name="Trend")
    assert trend["R001"].item() == pytest.approx(sheet["percent"].mean())


@pytest.mark.parametrize("name", ["book", "book.csv", "book.xls"])
def test_a_workbook_under_another_name_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    record(tmp_path / "data", "R001", vectors())
    assert main(["score", str(tmp_path / "data"), "--out", str(tmp_path / name)]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "is not a workbook; give a name that ends in .xlsx" in said
    assert [each.name for each in tmp_path.iterdir()] == ["data"]


def test_what_was_judged_after_a_test_is_in_the_trial_table_and_counts(tmp_path: Path) -> None:
    rows = [trial(60.0, reference=True), trial(60.0), trial(60.0, outcome="failure")]
    record(
        tmp_path,
        "R001",
        rows,
        more=[
            ("order.completion", 21.0, {"trial": 2, "attempt": 1, "after": True, "text": "0"}),
            ("order.override", 31.0, {"trial": 3, "attempt": 1, "after": True, "text": ""}),
        ],
    )
    first, second = scored(tmp_path)
    assert (first.indicator.completed, first.why) == (False, "set by the experimenter")
    after = "overridden by the experimenter after its end"
    assert (second.indicator.completed, second.why) == (True, after)
    table = open_recording(tmp_path / "R001" / "R001.h5").session(1).trials
    assert table.set_index("trial")["completion"].loc[2] == 0


def test_a_folder_without_tests_says_what_a_test_is(tmp_path: Path) -> None:
    record(tmp_path, "R001", [trial(60.0, reference=True)])
    with pytest.raises(RecordingError, match="no trial with the columns time, n_object, n_body"):
        scored(tmp_path)


def converted(book: Path, sheet: int) -> list[list[str]]:
    """Let LibreOffice open the workbook, work it out, and write one sheet as text.

    Several may run at once, in other tests' processes, so it shares neither its settings nor its
    folder of temporary files with another.
    """
    need("soffice")
    own = book.parent / "office"
    (own / "temporary").mkdir(parents=True, exist_ok=True)
    how = f"csv:Text - txt - csv (StarCalc):44,34,76,1,,0,false,true,false,false,false,{sheet}"
    home = f"-env:UserInstallation={(own / 'settings').as_uri()}"
    into = ["--headless", "--convert-to", how, "--outdir", str(book.parent), str(book)]
    done = ran(
        ["soffice", home, *into],
        env={"HOME": str(own), "TMPDIR": str(own / "temporary")},
        timeout=240,
    )
    assert done.returncode == 0, f"soffice ended with {done.returncode}: {done.stdout}{done.stderr}"
    [text] = book.parent.glob(f"{book.stem}-*.csv")
    rows = list(csv.reader(text.read_text().splitlines()))
    text.unlink()
    return rows


@pytest.mark.slow
def test_libreoffice_opens_the_workbook_and_its_totals_are_ours(tmp_path: Path) -> None:
    record(tmp_path, "R001", vectors())
    record(tmp_path, "R002", [trial(50.0, reference=True), trial(80.0, (2, 0, 1, 0))])
    record(tmp_path, "R002", [trial(64.0, (1, 0, 0, 0))], session=2)
    assert main(["score", str(tmp_path)]) == 0
    book = tmp_path / "evaluation.xlsx"
    head, *rows = converted(book, 2)
    tests = scored(tmp_path)
    assert len(rows) == len(tests) == 8
    for test, row in zip(tests, rows, strict=True):
        cells = dict(zip(head, row, strict=True))
        for name in ("objective", "subjective", "raw", "percent"):
            ours = pytest.approx(getattr(test.indicator, name), abs=1e-3)
            assert float(cells[name]) == ours
            assert float(cells[f"{name} (formula)"]) == ours
    head, *rows = converted(book, 1)
    assert [row[0] for row in rows] == ["R001", "R002"]
    mean = sum(test.indicator.percent for test in tests[6:]) / 2
    assert float(rows[1][3]) == pytest.approx(mean, abs=1e-3)
    # Lost to objects: 10 and 5 points; to time: 20 (1 - 50/80) = 7.5 and 4.4.
    assert rows[1][4].startswith("practise objects")
    head, *rows = converted(book, 3)
    assert head == ["session", "R001", "R002", "R001 (formula)", "R002 (formula)"]
    first = sum(test.indicator.percent for test in tests[:6]) / 6
    by_session = [[first, tests[6].indicator.percent], [None, tests[7].indicator.percent]]
    for session, row, means in zip((1, 2), rows, by_session, strict=True):
        assert float(row[0]) == session
        for cells in (row[1:3], row[3:5]):
            for cell, mean in zip(cells, means, strict=True):
                assert cell == "" if mean is None else float(cell) == pytest.approx(mean, abs=1e-3)


@pytest.mark.slow
def test_who_was_excluded_is_not_scored_and_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = Places(tmp_path / "data")
    with changed(places) as register:
        for slot, name in enumerate(("R001", "R002"), start=1):
            register.participants[name] = Entry(slot=slot, seed=1, enrolled="2026-01-01")
    for name in ("R001", "R002", "R003-SIMULATED"):
        record(places.root, name, [trial(50.0, reference=True), trial(80.0)])
    exclude(places, "R002", "was ill", date(2026, 1, 2))
    assert main(["score", str(places.root)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "left out: R002, excluded: on 2026-01-02: was ill" in said
    assert "left out: R003-SIMULATED, half-finished" in said
    (_, row) = converted(places.root / "evaluation.xlsx", 2)
    assert row[0] == "R001"


@pytest.mark.slow
def test_a_missing_rating_leaves_no_total_in_the_workbook(tmp_path: Path) -> None:
    record(tmp_path, "R001", [trial(60.0, reference=True), trial(60.0)], ratings=False)
    [test] = scored(tmp_path)
    write_workbook([test], tmp_path / "book.xlsx")
    head, row = converted(tmp_path / "book.xlsx", 2)
    cells = dict(zip(head, row, strict=True))
    assert (cells["raw"], cells["raw (formula)"]) == ("no rating", "#VALUE!")


def runs(percents: list[tuple[float, int]]) -> list[OperatorTest]:
    """Return tests of one operator with times in s and collisions with objects."""
    tests = []
    for number, (time, hits) in enumerate(percents, start=1):
        done = Performance(time, hits, 0, 0, 0, 0.5, 0.5, completed=True)
        made = indicate(done, 60.0, LITERAL)
        tests.append(OperatorTest("R001", 1, number, "doors", done, 60.0, "", made, LITERAL))
    return tests


def test_each_sheet_says_first_that_its_operators_are_simulated_and_its_formulas_still_hold(
    tmp_path: Path,
) -> None:
    from openpyxl import load_workbook

    tests = runs([(60.0, 0), (70.0, 2)])
    books = []
    for number, kinds in enumerate(("", "SIMULATED and PILOT")):
        write_workbook(tests, tmp_path / f"{number}.xlsx", kinds)
        books.append(load_workbook(tmp_path / f"{number}.xlsx"))
    for plain, stamped in zip(*books, strict=True):
        first, head, *rows = stamped.iter_rows(values_only=True)
        assert first[0] == "SIMULATED and PILOT"
        assert set(first[1:]) <= {None}
        assert stamped.freeze_panes == "A3"
        expected_head, *expected = plain.iter_rows(values_only=True)
        assert head == expected_head
        for number, (row, as_plain) in enumerate(zip(rows, expected, strict=True), start=3):
            for cell, other in zip(row, as_plain, strict=True):
                if isinstance(other, str) and other.startswith("="):
                    moved = re.sub(rf"(?<=[A-Z]){number - 1}\b", str(number), other)
                    assert cell == moved.replace("B$1", "B$2").replace("C$1", "C$2")
                else:
                    assert cell == other


def test_reports_of_deformities_are_in_the_workbook_as_hits_misses_and_false_alarms(
    tmp_path: Path,
) -> None:
    import pandas as pd

    nan = math.nan
    seen = [(1, 1, 0), (1, 1, 2), (1, 0, 1), (0, 0, 0), (0, 0, 0), (0, 0, 3), (nan, nan, 1)]
    tests = [
        replace(test, detection=Detection(*map(float, each)))
        for test, each in zip(runs([(60.0, 0)] * len(seen)), seen, strict=True)
    ]
    write_workbook(tests, tmp_path / "book.xlsx")
    sheet = pd.read_excel(tmp_path / "book.xlsx", sheet_name="Tests")
    columns = sheet[["deformity", "found", "false_reports"]].to_numpy(dtype=float)
    np.testing.assert_array_equal(columns, np.array(seen, dtype=float))
    (row,) = pd.read_excel(tmp_path / "book.xlsx", sheet_name="Deformities").to_dict("records")
    assert row == {
        "operator": "R001", "hits": 2, "misses": 1, "false alarms": 1, "correct rejections": 2
    }  # fmt: skip


def test_the_component_that_loses_most_is_practised_next() -> None:
    said = suggest(runs([(60.0, 3), (70.0, 4)]))
    assert said.verdict == "practise objects: keep clear of what is in the scene"
    assert said.evidence.startswith("mean loss in points over 2 tests: object 17.5")


def test_steady_times_below_the_first_show_familiarity() -> None:
    assert familiarity(runs([(90, 0), (70, 0), (62, 0), (61, 0), (60, 0)])).verdict == "familiar"
    said = familiarity(runs([(90, 0), (80, 0), (70, 0), (60, 0)]))
    assert said.verdict == "still learning"
    assert familiarity(runs([(60, 0)] * 3)).verdict == "too few runs to say"
    assert [familiarity(runs([(60, 0)] * n)).evidence for n in (1, 2)] == ["1 run", "2 runs"]
    assert [fatigue(runs([(60, 0)] * n)).evidence for n in (1, 2)] == ["1 run", "2 runs"]


def test_runs_that_worsen_again_suggest_another_scenario() -> None:
    tired = runs([(60, 2), (60, 0), (60, 0), (60, 0), (60, 2), (60, 2), (60, 3)])
    assert fatigue(tired).verdict == "fatigue: give another scenario"
    assert "best mean of 3 runs 91.7 %, last 81.9 %" in fatigue(tired).evidence
    assert fatigue(runs([(60, 2), (60, 1), (60, 0), (60, 0)])).verdict == "none"


def visit(times: list[float], ratings: list[float]) -> list[OperatorTest]:
    """Return one test of each scenario; each takes longer than the one before, as references do."""
    tests = []
    for number, (share, rating) in enumerate(zip(times, ratings, strict=True), start=1):
        reference = 20.0 * number
        done = Performance(share * reference, 0, 0, 0, 0, rating, 0.8, completed=True)
        made = indicate(done, reference, LITERAL)
        scene = f"scene {number}"
        tests.append(OperatorTest("R001", 1, number, scene, done, reference, "", made, LITERAL))
    return tests


def test_one_test_of_each_scenario_tells_familiarity_and_fatigue_of_all_together() -> None:
    settled = visit([1.5, 1.2, 1.02, 1.0, 1.01, 1.0], [0.5, 0.6, 0.7, 0.8, 0.8, 0.8])
    said = {each.about: each.verdict for each in advice(settled)}
    assert said["environmental familiarity, scene 1"] == "too few runs to say"
    assert said["environmental familiarity, all scenarios"] == "familiar"
    assert said["scenario fatigue, all scenarios"] == "none"
    unsure = visit([1.5, 1.2, 1.02, 1.0, 1.01, 1.0], [0.9, 0.9, 0.8, 0.6, 0.5, 0.5])
    found = familiarity(unsure)
    assert found.verdict == "still learning: felt accuracy has fallen"
    assert "1.00, 1.01, 1.00 of the reference spread 1 %, the first was 1.50" in found.evidence
    assert "rated accuracy went from 0.90 to 0.50, rated awareness went" in found.evidence
    tired = visit([1.0, 1.0, 1.0, 1.6, 1.7, 1.8], [0.9, 0.9, 0.9, 0.5, 0.4, 0.4])
    found = fatigue(tired)
    assert found.verdict == "fatigue: give other scenarios, or a break"
    (one,) = {each.operator for each in advice(tired)}
    assert one == "R001"
    assert "all scenarios" not in str(list(advice(runs([(60, 0)] * 4))))


def test_a_session_without_a_tick_does_not_take_the_others_with_it(tmp_path: Path) -> None:
    home = tmp_path / "P001"
    record(tmp_path, "P001", vectors())
    path = home / "ses-02_run.xdf"
    with SessionJournal(path, [Column("state", "joint.angle.boom", "rad")], 240.0) as journal:
        journal.write_event(Event("session.start", 1.0, {"participant": "P001"}), 0)
    consolidate(home / "P001.h5", [path])
    (person,) = find_cohort(tmp_path, ["half-finished"]).included
    assert [number for number, _ in person.sessions()] == [1]


def test_a_test_of_which_the_operator_saw_nothing_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [trial(60.0, reference=True), trial(90.0), trial(80.0)]
    record(tmp_path, "P001", rows)
    record(tmp_path, "P002", rows, views=["cab"])
    record(tmp_path, "P002", rows, session=2)  # its reference is of a session that was seen
    said = []
    tests = operator_tests(
        find_cohort(tmp_path, ["half-finished"]),
        leave_out=lambda name, why: said.append((name, why)),
    )
    assert [(test.operator, test.session, test.trial) for test in tests] == [
        ("P001", 1, 2), ("P001", 1, 3), ("P002", 2, 2), ("P002", 2, 3),
    ]  # fmt: skip
    unseen = ", ".join(f"trial {number} of session 1" for number in (1, 2, 3))
    assert said == [
        ("P002", f"saw or heard too little in {unseen}, which are not scored "
         "(presented: in the protocol)"),
    ]  # fmt: skip
    assert main(["score", str(tmp_path)]) == LEFT_OUT
    assert f"left out: P002 saw or heard too little in {unseen}" in " ".join(
        capsys.readouterr().out.split()
    )
