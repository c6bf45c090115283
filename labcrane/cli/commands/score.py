"""The command that evaluates operators: score."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labcrane.cli.commands.approval import today
from labcrane.cli.commands.results import LEFT_OUT, cohort_of
from labcrane.cli.options import StudyData
from labcrane.cli.output import out, print_rows
from labcrane.errors import LabcraneError

if TYPE_CHECKING:
    from labcrane.analysis.scoring.settings import IndicatorSettings

HALF_FINISHED = "half-finished"


def score(
    folder: StudyData,
    into: Annotated[
        Path | None, typer.Option("--out", help="the workbook; FOLDER/evaluation.xlsx by default")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(help="YAML with weights, reading, mistakes, capped; as recorded by default"),
    ] = None,
    include: Annotated[
        list[str] | None, typer.Option(help="also use: simulated, pilot; may be repeated")
    ] = None,
) -> None:
    """Write the evaluation workbook: performance indicator, trend, recommended practice."""
    from labcrane.analysis.cohort import kinds_of
    from labcrane.analysis.report.workbook import advice, write_csv, write_workbook
    from labcrane.analysis.scoring.operator_tests import operator_tests
    from labcrane.participants.products import product

    path = into or folder / "evaluation.xlsx"
    if path.suffix != ".xlsx":
        raise LabcraneError(
            f"--out {path} is not a workbook; give a name that ends in .xlsx; the tests go into a "
            ".csv file in the same folder"
        )
    # Operators are scored while they are still in training.
    cohort = cohort_of(folder, [HALF_FINISHED, *(include or ())])
    left_out: list[str] = []

    def leave_out(name: str, why: str) -> None:
        left_out.append(name)
        out.print(f"left out: {name} {why}", markup=False)

    tests = operator_tests(cohort, _settings(settings) if settings else None, leave_out)
    names = [person.name for person in cohort.included]
    with product(folder, "score", path.resolve().parent, names, today(), whole=True) as made:
        write_workbook(tests, made.folder / path.name, kinds_of(cohort.included))
        write_csv(tests, made.folder / path.with_suffix(".csv").name)
    rows = [
        (
            *(test.operator, str(test.session), str(test.trial), test.scenario),
            *(f"{test.indicator.raw:.1f}", f"{test.indicator.percent:.1f}"),
        )
        for test in tests
    ]
    print_rows(("operator", "session", "trial", "scenario", "raw", "percent"), rows)
    for each in advice(tests):
        out.print(f"{each.operator}, {each.about}: {each.verdict} ({each.evidence})", markup=False)
    out.print(f"workbook: {path}, and its tests as {path.with_suffix('.csv').name}", markup=False)
    if left_out or cohort.unreadable:
        raise typer.Exit(LEFT_OUT)


def _settings(path: Path) -> "IndicatorSettings":
    from labcrane.analysis.scoring.settings import IndicatorSettings
    from labcrane.files.yaml import YamlFile

    return YamlFile.read(path).checked(IndicatorSettings)
