"""Primary outcomes: what a protocol may name, and what the recording says of it."""

from pathlib import Path

import pytest
from rehearsal import loaded
from results.undrawn import without_figures
from simple_crane import CRANE

from labcrane import ProtocolError
from labcrane.analysis import find_cohort
from labcrane.analysis.report.report import write_report
from labcrane.testing import main

STUDY = (
    """\
labcrane: 1
study: primary
title: What counts
rate_hz: 60
"""
    + CRANE
    + """\
tasks: {aiming: {use: aiming, distances: [2], movements: 2}}
design:
  primary: [circle_to_circle, sparc]
sessions: [{name: one, steps: [{block: {task: aiming, pairs: 1}}]}]
"""
)


def line_of(text: str, word: str) -> int:
    (number,) = [n for n, line in enumerate(text.splitlines(), start=1) if word in line]
    return number


def refusal(folder: Path, text: str) -> str:
    path = folder / "protocol.yaml"
    path.write_text(text)
    with pytest.raises(ProtocolError) as caught:
        loaded(path)
    return str(caught.value)


def test_a_result_of_a_task_and_a_measure_of_a_movement_can_be_primary(tmp_path: Path) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(STUDY)
    assert loaded(path).protocol.design.primary == ("circle_to_circle", "sparc")


def test_an_outcome_that_nothing_gives_is_refused_with_its_line_and_what_there_is(
    tmp_path: Path,
) -> None:
    text = STUDY.replace("circle_to_circle", "circle_to_cirlce")
    said = refusal(tmp_path, text)
    assert f":{line_of(text, 'primary: [')}:" in said
    assert "there is no outcome 'circle_to_cirlce'; did you mean 'circle_to_circle'?" in said


def test_an_outcome_that_is_named_twice_is_refused(tmp_path: Path) -> None:
    said = refusal(tmp_path, STUDY.replace("sparc", "circle_to_circle"))
    assert "'circle_to_circle' is listed twice; list it once" in said


@pytest.mark.slow
@pytest.mark.parametrize("named", [True, False])
def test_the_report_says_which_outcomes_the_recorded_protocol_calls_primary(
    tmp_path: Path, *, named: bool
) -> None:
    path = tmp_path / "protocol.yaml"
    path.write_text(STUDY if named else STUDY.replace("circle_to_circle, sparc", ""))
    data = tmp_path / "data"
    assert main(["simulate", str(path), "--participants", "1", "--out", str(data)]) == 0
    cohort = find_cohort(data, ["simulated"])
    with without_figures():
        page = write_report(cohort, tmp_path / "report").read_text()
    primary = cohort.included[0].context.get("primary")
    if named:
        assert primary == ["circle_to_circle", "sparc"]
        assert "Primary outcomes, as the protocol names them: circle_to_circle, sparc." in page
    else:
        assert primary is None
        usual = "movement_time, absolute_error, circle_to_circle"
        assert f"The protocol names no primary outcomes: {usual} are used as such." in page
