"""The evaluation workbook: tests, operators, trend and advice, totals as values and as formulas."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
TOTALS = ("objective", "subjective", "raw", "percent")
"""Columns that follow from others: written as values, and again as formulas."""

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
    head = [*_values(tests[0]), *(f"{name} (formula)" for name in TOTALS)]
    at = {name: _letters(column) for column, name in enumerate(head, start=1)}
    first = _begin(summary, SUMMARY, kinds)
    _fill(summary, _operators(tests, first, at))
    sheet = book.create_sheet("Tests")
    first = _begin(sheet, head, kinds)
    _fill(
        sheet,
        ([*_values(test).values(), *_formulas(at, row)] for row, test in enumerate(tests, first)),
    )
    _trend(book, tests, kinds, at)
    for title, columns, rows in (
        ("Deformities", ("operator", *KINDS), _detections(tests)),
        (
            "Advice",
            ("operator", "about", "verdict", "evidence"),
            ((a.operator, a.about, a.verdict, a.evidence) for a in advice(tests)),
        ),
        ("Settings", ("operator", "session", "setting", "value"), _used(tests)),
    ):
        sheet = book.create_sheet(title)
        _begin(sheet, columns, kinds)
        _fill(sheet, rows)
    book.save(path)


def write_csv(tests: Sequence[OperatorTest], path: Path) -> None:
    """Write the sheet ``Tests`` as CSV: its values, without the formulas."""
    import csv

    rows = [_values(test) for test in tests]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(rows[0])
        writer.writerows(map(_safe, row.values()) for row in rows)


def advice(tests: Sequence[OperatorTest]) -> Iterator[Advice]:
    """Yield the advice for each operator."""
    for _, own in groupby(tests, key=lambda test: test.operator):
        mine = list(own)
        yield suggest(mine)
        names = dict.fromkeys(test.scenario for test in mine)
        of_each = [[test for test in mine if test.scenario == name] for name in names]
        several = [mine] if len(names) > 1 else []  # perhaps with one test of each
        for runs in (*of_each, *several):
            yield familiarity(runs)
            yield fatigue(runs)


def _values(test: OperatorTest) -> dict[str, Cell]:
    """Return the values of a test by their columns."""
    performance, indicator = test.performance, test.indicator
    return {
        **{name: getattr(test, name) for name in ("operator", "session", "trial", "scenario")},
        "duration_s": performance.duration_s,
        "reference_s": test.reference_s,
        **{f"n_{name}": getattr(performance, name) for name in OBJECTIVE[1:]},
        **{f"s_{name}": _number(getattr(performance, name)) for name in SUBJECTIVE},
        "n_drop": performance.drop,
        **{name: _known(getattr(test.detection, name)) for name in DETECTION},
        "k": int(indicator.completed),
        "k because": test.why,
        **{f"points {name}": _number(indicator.points.get(name)) for name in COMPONENTS},
        **{f"weight {name}": indicator.largest.get(name) for name in COMPONENTS},
        **{name: _number(getattr(indicator, name)) for name in TOTALS},
    }


def _formulas(at: Mapping[str, str], row: int) -> tuple[Cell, ...]:
    """Return the formulas of :data:`TOTALS` in a row, from the letters of columns."""
    cell = {name: f"{letters}{row}" for name, letters in at.items()}
    return (
        f"=SUM({cell['points duration']}:{cell['points overload_min']})",
        f"={cell['points accuracy']}+{cell['points awareness']}",
        f"={cell['k']}*({cell['objective (formula)']}+{cell['subjective (formula)']})",
        f"=100*{cell['raw (formula)']}/SUM({cell['weight duration']}:{cell['weight awareness']})",
    )


def _operators(
    tests: Sequence[OperatorTest], first: int, at: Mapping[str, str]
) -> Iterator[tuple[Cell, ...]]:
    names = dict.fromkeys(test.operator for test in tests)
    for row, operator in enumerate(names, start=first):
        own = [test for test in tests if test.operator == operator]
        yield (
            operator,
            len(own),
            _number(fmean(test.indicator.raw for test in own)),
            _number(fmean(test.indicator.percent for test in own)),
            suggest(own).verdict,
            f"=AVERAGEIFS({_column(at, 'raw (formula)')},{_column(at, 'operator')},A{row})",
            f"=AVERAGEIFS({_column(at, 'percent (formula)')},{_column(at, 'operator')},A{row})",
        )


def _trend(
    book: "Workbook", tests: Sequence[OperatorTest], kinds: str, at: Mapping[str, str]
) -> None:
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
        by = f"{_column(at, 'operator')},{name},{_column(at, 'session')},$A{row}"
        return f"=AVERAGEIFS({_column(at, 'percent (formula)')},{by})"

    rows = (
        (
            session,
            *(mean(name, session) for name in operators),
            *(formula(name, column, row) for column, name in enumerate(operators, start=2)),
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


def _column(at: Mapping[str, str], name: str) -> str:
    return f"Tests!${at[name]}:${at[name]}"


def _letters(column: int) -> str:
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column))
