"""The evaluation workbook: tests, operators, trend and advice, totals as values and as formulas."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

from labcrane.analysis.advice import Advice, familiarity, fatigue, suggest
from labcrane.analysis.scoring.indicator import FORMULA, OBJECTIVE, SUBJECTIVE
from labcrane.analysis.scoring.operator_tests import DETECTION, OperatorTest

if TYPE_CHECKING:
    from openpyxl import Workbook
    from openpyxl.worksheet.worksheet import Worksheet

Cell = str | int | float | None

COMPONENTS = (*OBJECTIVE, *SUBJECTIVE)
FACTS = ("operator", "session", "trial", "scenario", "duration_s", "reference_s")
COUNTS = ("object", "body", "overload_max", "overload_min", "accuracy", "awareness")
HEAD = (
    *FACTS,
    *(f"n_{name}" if name in OBJECTIVE else f"s_{name}" for name in COUNTS),
    "n_drop",
    *DETECTION,
    "k",
    "k because",
    *(f"points {name}" for name in COMPONENTS),
    *(f"weight {name}" for name in COMPONENTS),
    "objective",
    "subjective",
    "raw",
    "percent",
    *(f"{name} (formula)" for name in ("objective", "subjective", "raw", "percent")),
)
SUMMARY = (
    "operator",
    "tests",
    "raw",
    "percent",
    "suggestion",
    "raw (formula)",
    "percent (formula)",
)
KINDS = {
    "hits": "hit",
    "misses": "miss",
    "false alarms": "false alarm",
    "correct rejections": "correct rejection",
}
"""Outcomes of a test with a question on a deformity."""

WIDTH = 14
NO_RATING = "no rating"


def write_workbook(tests: Sequence[OperatorTest], path: Path, kinds: str = "") -> None:
    """Write the workbook of ``tests``, which are in order of operator and time.

    ``kinds`` is the first line of each sheet: ``SIMULATED``, ``PILOT``; empty if all are real
    recordings. Sheets are copied and printed one by one.
    """
    from openpyxl import Workbook

    book = Workbook()
    summary = book.active
    if summary is None:
        raise AssertionError("a new workbook has a sheet")
    summary.title = "Summary"
    first = _begin(summary, SUMMARY, kinds)
    _fill(summary, _operators(tests, first))
    sheet = book.create_sheet("Tests")
    first = _begin(sheet, HEAD, kinds)
    _fill(sheet, map(_row, tests, range(first, first + len(tests))))
    _trend(book, tests, kinds)
    for title, head, rows in (
        ("Deformities", ("operator", *KINDS), _detections(tests)),
        (
            "Advice",
            ("operator", "about", "verdict", "evidence"),
            ((a.operator, a.about, a.verdict, a.evidence) for a in advice(tests)),
        ),
        ("Settings", ("operator", "session", "setting", "value"), _used(tests)),
    ):
        sheet = book.create_sheet(title)
        _begin(sheet, head, kinds)
        _fill(sheet, rows)
    book.save(path)


def write_csv(tests: Sequence[OperatorTest], path: Path) -> None:
    """Write the sheet ``Tests`` as CSV: its values, without the formulas."""
    import csv

    columns = [at for at, name in enumerate(HEAD) if not name.endswith("(formula)")]
    rows = [_row(test, number) for number, test in enumerate(tests, start=2)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([HEAD[at] for at in columns])
        writer.writerows([_safe(row[at]) for at in columns] for row in rows)


def advice(tests: Sequence[OperatorTest]) -> Iterator[Advice]:
    """Yield the advice for each operator."""
    for _, own in groupby(tests, key=lambda test: test.operator):
        mine = list(own)
        yield suggest(mine)
        scenarios = dict.fromkeys(test.scenario for test in mine)
        for scenario in scenarios:
            runs = [test for test in mine if test.scenario == scenario]
            yield familiarity(runs)
            yield fatigue(runs)
        if len(scenarios) > 1:  # perhaps with one test of each
            yield familiarity(mine, across=True)
            yield fatigue(mine, across=True)


def _row(test: OperatorTest, number: int) -> tuple[Cell, ...]:
    performance, indicator = test.performance, test.indicator
    points = [_number(indicator.points.get(name)) for name in COMPONENTS]
    weights = [indicator.largest.get(name) for name in COMPONENTS]
    at = {name: _letters(HEAD.index(name) + 1) + str(number) for name in HEAD}
    k, raw = at["k"], at["raw (formula)"]
    objective = f"=SUM({at['points duration']}:{at['points overload_min']})"
    subjective = f"={at['points accuracy']}+{at['points awareness']}"
    return (
        test.operator,
        test.session,
        test.trial,
        test.scenario,
        performance.duration_s,
        test.reference_s,
        *(_number(getattr(performance, name)) for name in COUNTS),
        performance.drop,
        *(_known(getattr(test.detection, name)) for name in DETECTION),
        int(indicator.completed),
        test.why,
        *points,
        *weights,
        *map(
            _number, (indicator.objective, indicator.subjective, indicator.raw, indicator.percent)
        ),
        objective,
        subjective,
        f"={k}*({at['objective (formula)']}+{at['subjective (formula)']})",
        f"=100*{raw}/SUM({at['weight duration']}:{at['weight awareness']})",
    )


def _operators(tests: Sequence[OperatorTest], first: int) -> Iterator[tuple[Cell, ...]]:
    names = dict.fromkeys(test.operator for test in tests)
    for row, operator in enumerate(names, start=first):
        own = [test for test in tests if test.operator == operator]
        yield (
            operator,
            len(own),
            _number(fmean(test.indicator.raw for test in own)),
            _number(fmean(test.indicator.percent for test in own)),
            suggest(own).verdict,
            f"=AVERAGEIFS({_column('raw (formula)')},{_column('operator')},A{row})",
            f"=AVERAGEIFS({_column('percent (formula)')},{_column('operator')},A{row})",
        )


def _trend(book: "Workbook", tests: Sequence[OperatorTest], kinds: str) -> None:
    from openpyxl.chart import LineChart, Reference

    sheet = book.create_sheet("Trend")
    operators = list(dict.fromkeys(test.operator for test in tests))
    sessions = sorted({test.session for test in tests})
    head = ("session", *operators, *(f"{name} (formula)" for name in operators))
    first = _begin(sheet, head, kinds)
    percents: dict[tuple[str, int], list[float]] = {}
    for test in tests:
        percents.setdefault((test.operator, test.session), []).append(test.indicator.percent)

    def mean(operator: str, session: int) -> Cell:
        own = percents.get((operator, session))
        return None if own is None else _number(fmean(own))

    def formula(operator: str, column: int, row: int) -> Cell:
        if (operator, sessions[row - first]) not in percents:
            return None
        name = f"{_letters(column)}${first - 1}"
        by = f"{_column('operator')},{name},{_column('session')},$A{row}"
        return f"=AVERAGEIFS({_column('percent (formula)')},{by})"

    rows = (
        (
            session,
            *(mean(name, session) for name in operators),
            *(formula(name, at, row) for at, name in enumerate(operators, start=2)),
        )
        for row, session in enumerate(sessions, start=first)
    )
    _fill(sheet, rows)
    chart = LineChart()
    chart.title, chart.y_axis.title, chart.x_axis.title = "Indicator", "percent", "session"
    chart.x_axis.delete = chart.y_axis.delete = False
    last = first + len(sessions) - 1
    chart.add_data(
        Reference(sheet, min_col=2, max_col=len(operators) + 1, min_row=first - 1, max_row=last),
        titles_from_data=True,
    )
    chart.set_categories(Reference(sheet, min_col=1, min_row=first, max_row=last))
    sheet.add_chart(chart, f"{_letters(2 * len(operators) + 3)}2")


def _used(tests: Sequence[OperatorTest]) -> Iterator[tuple[Cell, ...]]:
    seen = set()
    for test in tests:
        if (test.operator, test.session) in seen:
            continue
        seen.add((test.operator, test.session))
        settings = test.settings
        pairs: list[tuple[str, Cell]] = [
            ("formula", FORMULA),
            ("reading", settings.reading),
            ("mistakes", settings.mistakes),
            ("capped", "yes" if settings.capped else "no"),
        ]
        pairs += [(f"weight {name}", value) for name, value in settings.weights]
        for name, value in pairs:
            yield test.operator, test.session, name, value


def _begin(sheet: "Worksheet", head: Sequence[str], kinds: str) -> int:
    """Write the head of a sheet; return the number of its first row."""
    from openpyxl.styles import Font

    above = [[kinds], list(head)] if kinds else [list(head)]
    for line in above:
        sheet.append(line)
        for cell in sheet[sheet.max_row]:
            cell.font = Font(bold=True)
    first = len(above) + 1
    sheet.freeze_panes = f"A{first}"
    for column in range(1, len(head) + 1):
        sheet.column_dimensions[_letters(column)].width = WIDTH
    return first


def _fill(sheet: "Worksheet", rows: Iterable[Sequence[Cell]]) -> None:
    for row in rows:
        sheet.append([_safe(value) for value in row])


def _safe(value: Cell) -> Cell:
    """Return an external text so that spreadsheets do not take it for a formula."""
    written = isinstance(value, str) and value[:1] in {"+", "-", "@"}
    return f"'{value}" if written else value


def _detections(tests: Sequence[OperatorTest]) -> Iterator[tuple[Cell, ...]]:
    """Yield each operator's numbers of right and wrong reports on deformities."""
    for operator in dict.fromkeys(test.operator for test in tests):
        own = [test.detection.kind for test in tests if test.operator == operator]
        if any(own):
            yield (operator, *(own.count(kind) for kind in KINDS.values()))


def _known(value: float) -> Cell:
    return None if math.isnan(value) else int(value)


def _number(value: float | None) -> Cell:
    return NO_RATING if value is not None and math.isnan(value) else value


def _column(name: str) -> str:
    letters = _letters(HEAD.index(name) + 1)
    return f"Tests!${letters}:${letters}"


def _letters(column: int) -> str:
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column))
