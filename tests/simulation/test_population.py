"""Whom a simulated study has for participants."""

from pathlib import Path

import numpy as np
import pytest
from simple_crane import CRANE

from labcrane.cli.app import main
from labcrane.design.plan import plan_session
from labcrane.errors import ProtocolError
from labcrane.protocol.study import Study, load
from labcrane.registry.registry import discover
from labcrane.simulation.population import Lognormal, Population, read_population

COUNT = 2000
STUDY = (
    """\
labcrane: 1
study: population
title: A population
"""
    + CRANE
    + """\
tasks:
  aiming: {use: aiming, distances: [2, 4], movements: 2}
design:
  groups: {none: [], slow: []}
sessions:
  - {name: one, steps: [{block: {task: aiming}}]}
"""
)


@pytest.fixture
def study(tmp_path: Path) -> Study:
    path = tmp_path / "protocol.yaml"
    path.write_text(STUDY)
    return load(path, discover())


def names() -> list[str]:
    return [f"P{number:04}" for number in range(1, COUNT + 1)]


def test_participants_are_drawn_from_the_distribution_that_is_written(study: Study) -> None:
    population = Population.model_validate(
        {
            "labcrane_cohort": 1,
            "operator": {
                "fitts_b_s": {"median": 2.0, "log_sd": 0.3},
                "lapse_rate": {"lowest": 0.1, "highest": 0.3},
            },
        }
    )
    drawn = [population.drawn(study, name) for name in names()]
    logs = np.log([one["fitts_b_s"] for one in drawn])
    assert logs.mean() == pytest.approx(np.log(2.0), abs=4 * 0.3 / np.sqrt(COUNT))
    assert logs.std() == pytest.approx(0.3, abs=4 * 0.3 / np.sqrt(2 * COUNT))
    lapses = np.array([one["lapse_rate"] for one in drawn])
    assert 0.1 <= lapses.min() < 0.102
    assert 0.298 < lapses.max() <= 0.3


def test_another_setting_changes_nobody(study: Study) -> None:
    one = {"learning_rate": Lognormal(median=0.1, log_sd=0.4)}
    two = one | {"fitts_b_s": Lognormal(median=2.5, log_sd=0.2)}
    first, second = (Population(labcrane_cohort=1, operator=given) for given in (one, two))
    for name in names()[:20]:
        assert (
            first.drawn(study, name)["learning_rate"]
            == (second.drawn(study, name)["learning_rate"])
        )


def test_a_group_has_its_effect_and_no_other_group(study: Study) -> None:
    population = Population(labcrane_cohort=1, groups={"slow": {"fitts_b_s": 2.0}})
    slow, none = (
        population.study_of(study, "P001", group).operator.settings.model_dump()
        for group in ("slow", "none")
    )
    assert slow["fitts_b_s"] == 2.0 * none["fitts_b_s"]
    assert {name for name in slow if slow[name] != none[name]} == {"fitts_b_s"}


def test_as_many_leave_as_is_written_and_in_any_trial(study: Study) -> None:
    population = Population(labcrane_cohort=1, dropout=0.25)
    left = [population.leaves_at(study, plan_session(study, name, 1)) for name in names()[:400]]
    when = [trial for trial in left if trial is not None]
    assert len(when) == pytest.approx(100, abs=4 * np.sqrt(400 * 0.25 * 0.75))
    trials = sum(len(block.trials) for block in plan_session(study, "P001", 1).blocks)
    assert set(when) == set(range(1, trials + 1))


def test_a_lapse_delays_the_movement_by_as_much_as_it_lasts() -> None:
    from operator_loop import Loop, ends

    target = ends(2.0)[0]
    plain, lapsed = (
        Loop(settings={"lapse_rate": rate, "lapse_s": 1.5}).trial(target).first_push_s
        for rate in (0.0, 1.0)
    )
    assert lapsed - plain == pytest.approx(1.5, abs=0.01)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "operator: {skill: {median: 1, log_sd: 0}}",
            r":2:12: 'skill' is no number that 'simulated",
        ),
        ("groups: {loud: {fitts_b_s: 2}}", r":2:10: there is no group 'loud'; there is none, slow"),
        ("operator: {lapse_s: {lowest: 2, highest: 1}}", r":2:21: .*lowest is 2, above highest, 1"),
        ("dropouts: 0.1", r":2:1: 'dropouts' is not a key of the file; did you mean 'dropout'\?"),
    ],
)
def test_mistakes_are_named_with_their_line(study: Study, text: str, message: str) -> None:
    path = study.path.with_name("cohort.yaml")
    path.write_text(f"labcrane_cohort: 1\n{text}\n")
    with pytest.raises(ProtocolError, match=message):
        read_population(path, study)


def test_a_value_that_no_operator_can_have_is_refused(
    study: Study, capsys: pytest.CaptureFixture[str]
) -> None:
    cohort = study.path.with_name("cohort.yaml")
    cohort.write_text("labcrane_cohort: 1\noperator: {lapse_rate: {lowest: 2, highest: 3}}\n")
    out = str(study.path.parent / "data")
    assert main(["simulate", str(study.path), "--out", out, "--participants", "1"]) == 2
    said = capsys.readouterr().err
    assert "participant P001 was drawn with lapse_rate 2." in said
    assert "which 'simulated_operator' cannot have" in said
    assert "narrow its distribution" in said
