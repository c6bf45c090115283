"""Whom a simulated study has for participants."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rehearsal import loaded
from scipy.stats import truncnorm
from simple_crane import CRANE

from labcrane import ProtocolError
from labcrane.analysis import answers_of, find_cohort
from labcrane.simulation.population import Lognormal, Population, read_population
from labcrane.testing import Study, main, plan_session

COUNT = 2000
CRANE_PILOT = Path(__file__).parents[2] / "protocols" / "crane_pilot"
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
    return loaded(path)


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
            r":2:12: 'skill' is not a numeric setting of 'simulated",
        ),
        ("groups: {loud: {fitts_b_s: 2}}", r":2:10: there is no group 'loud'; there is none, slow"),
        ("operator: {lapse_s: {lowest: 2, highest: 1}}", r":2:30: .*lowest is 2, above highest, 1"),
        ("dropouts: 0.1", r":2:1: 'dropouts' is not a key of the file; did you mean 'dropout'\?"),
    ],
)
def test_mistakes_are_named_with_their_line(study: Study, text: str, message: str) -> None:
    path = study.path.with_name("cohort.yaml")
    path.write_text(f"labcrane_cohort: 1\n{text}\n")
    with pytest.raises(ProtocolError, match=message):
        read_population(path, study)


def test_a_wrong_number_hides_no_wrong_name_beside_it(study: Study) -> None:
    path = study.path.with_name("cohort.yaml")
    path.write_text(
        "labcrane_cohort: 1\ndropout: 1.5\noperator: {skill: {median: 1, log_sd: 0.1}}\n"
        "groups: {loud: {skill: 2}}\n"
    )
    with pytest.raises(ProtocolError) as told:
        read_population(path, study)
    first, *others = str(told.value).splitlines()
    assert ":2:10: dropout is 1.5; it must be less than or equal to 1" in first
    assert [each.split(" ")[1] for each in others] == ["'skill'", "there", "'skill'"]


def test_a_wrong_cohort_beside_the_protocol_is_told_by_its_check(
    study: Study, capsys: pytest.CaptureFixture[str]
) -> None:
    cohort = study.path.with_name("cohort.yaml")
    cohort.write_text("labcrane_cohort: 1\ndropout: 5\n")
    assert main(["check", str(study.path)]) == 2
    said = "".join(capsys.readouterr().err.split("\n"))
    assert "cohort.yaml:2:10: dropout is 5; it must be less than or equal to 1" in said
    cohort.write_text("labcrane_cohort: 1\ndropout: 0.5\n")
    assert main(["check", str(study.path)]) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "operator: {lapse_rate: {lowest: 0.5, highest: 3}}",
            r":2:47: lapse_rate is 3; it must be less than or equal to 1",
        ),
        (
            "operator: {pace_sd: {lowest: -1, highest: 0.5}}",
            r":2:30: pace_sd is -1; it must be greater than or equal to 0",
        ),
        (
            "operator: {inside: {median: 1.2, log_sd: 0.1}}",
            r":2:29: inside is 1.2; it must be less than or equal to 1",
        ),
        (
            "groups: {slow: {inside: 2}}",
            r":2:25: inside is 2 times 0.8, 1.6; it must be less than or equal to 1",
        ),
        (
            "operator: {inside: {lowest: 0.4, highest: 0.6}}\ngroups: {slow: {inside: 2}}",
            r":3:25: inside is 2 times 0.6, 1.2; it must be less than or equal to 1",
        ),
    ],
)
def test_values_that_no_operator_can_have_are_told_by_the_check(
    study: Study, text: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    cohort = study.path.with_name("cohort.yaml")
    cohort.write_text(f"labcrane_cohort: 1\n{text}\n")
    with pytest.raises(ProtocolError, match=message) as told:
        read_population(cohort, study)
    assert len(str(told.value).splitlines()) == 1
    assert main(["check", str(study.path)]) == 2


def test_what_a_factor_makes_possible_and_what_is_possible_alone_pass(study: Study) -> None:
    cohort = study.path.with_name("cohort.yaml")
    cohort.write_text(
        "labcrane_cohort: 1\noperator: {inside: {lowest: 0.1, highest: 1}, "
        "lapse_rate: {lowest: 0, highest: 1}}\ngroups: {slow: {inside: 0.5}}\n"
    )
    read_population(cohort, study)


@pytest.mark.slow
def test_a_tail_that_no_operator_can_have_is_told_of_whom_it_was_drawn_for(
    study: Study, capsys: pytest.CaptureFixture[str]
) -> None:
    cohort = study.path.with_name("cohort.yaml")
    cohort.write_text("labcrane_cohort: 1\noperator: {inside: {median: 1, log_sd: 0.001}}\n")
    out = str(study.path.parent / "data")
    assert main(["simulate", str(study.path), "--out", out, "--participants", "12"]) == 2
    said = capsys.readouterr().err
    assert "was drawn with inside 1" in said
    assert "which 'simulated_operator' cannot have: it must be less than or equal to 1" in said
    assert "narrow its distribution" in said


PERSON = "questionnaires: {person: {use: demographics, ask: [age, gender, handedness, gaming]}}\n"


@pytest.fixture
def asking(tmp_path: Path) -> Study:
    path = tmp_path / "asking.yaml"
    path.write_text(STUDY.replace("design:\n", PERSON + "design:\n"))
    return loaded(path)


def test_answers_are_drawn_from_the_distributions_that_are_written(asking: Study) -> None:
    age = {"mean": 24.19, "sd": 4.31, "lowest": 18.0, "highest": 35.0}
    person = {"age": age, "gender": {"shares": {"male": 20.0, "female": 16.0}}}
    person["gaming"] = {"lowest": 1.5, "highest": 2.5}
    population = Population.model_validate({"labcrane_cohort": 1, "answers": {"person": person}})
    said = [population.study_of(asking, name).answers["person"] for name in names()]
    assert all(set(one) == set(person) for one in said)
    ages = np.array([one["age"] for one in said])
    assert (ages.min(), ages.max()) == (18.0, 35.0)
    assert (ages == np.round(ages)).all()
    # A bell cut off at both ends, by scipy; rounding to years moves neither by a tenth.
    low, high = (18.0 - 24.19) / 4.31, (35.0 - 24.19) / 4.31
    bell = truncnorm(low, high, loc=24.19, scale=4.31)
    assert ages.mean() == pytest.approx(bell.mean(), abs=0.1 + 4 * bell.std() / np.sqrt(COUNT))
    assert ages.std() == pytest.approx(bell.std(), abs=0.1 + 4 * bell.std() / np.sqrt(2 * COUNT))
    men = np.mean([one["gender"] == "male" for one in said])
    assert men == pytest.approx(20 / 36, abs=4 * np.sqrt(20 / 36 * 16 / 36 / COUNT))
    hours = np.array([one["gaming"] for one in said])
    assert 1.5 <= hours.min() < 1.55
    assert 2.45 < hours.max() <= 2.5


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ("{persn: {}}", "there is no questionnaire 'persn'; did you mean 'person'"),
        ("{person: {aeg: {lowest: 18, highest: 35}}}", "'person' does not ask 'aeg'; did you mean"),
        (
            "{person: {gender: {shares: {men: 20}}}}",
            "'gender' has no choice men; it has female, male, other",
        ),
        (
            "{person: {age: {shares: {male: 20}}}}",
            "'age' is not a choice but 16 to 99 in steps of 1; give mean",
        ),
        (
            "{person: {gender: {lowest: 1, highest: 2}}}",
            "'gender' is not a number but one of female",
        ),
        ("{person: {age: {lowest: 10, highest: 35}}}", "'age' is from 16 to 99, not from 10 to 35"),
        ("{person: {age: {lowest: 18.5, highest: 35}}}", "and 18.5 is none of them"),
        (
            "{person: {age: {mean: 60, sd: 1, lowest: 18, highest: 35}}}",
            "the mean, 60, is not between lowest, 18, and highest, 35",
        ),
    ],
)
def test_answers_that_nobody_could_give_are_refused_with_what_there_is(
    asking: Study, tmp_path: Path, answers: str, message: str
) -> None:
    path = tmp_path / "cohort.yaml"
    path.write_text(f"labcrane_cohort: 1\nanswers: {answers}\n")
    with pytest.raises(ProtocolError) as caught:
        read_population(path, asking)
    assert message in str(caught.value)
    assert "cohort.yaml:2:" in str(caught.value)


def test_the_simulated_people_of_the_crane_study_are_those_of_the_paper() -> None:
    """Who answers is in the recordings: 18 to 35 years old, and both genders, others none."""
    study = loaded(CRANE_PILOT / "protocol.yaml")
    population = read_population(CRANE_PILOT / "cohort.yaml", study)
    said = [population.study_of(study, name).answers["person"] for name in names()[:36]]
    assert all(18.0 <= one["age"] <= 35.0 for one in said)
    assert {one["gender"] for one in said} == {"male", "female"}


@pytest.mark.slow
def test_answers_of_the_cohort_stand_in_the_recording_and_change_no_others(
    asking: Study, tmp_path: Path
) -> None:
    step = "steps: [{block"
    asking.path.write_text(
        asking.path.read_text().replace(step, "steps: [{questionnaire: person}, {block")
    )
    cohort = tmp_path / "cohort.yaml"
    said = []
    for number, text in enumerate(["", "answers: {person: {age: {lowest: 20, highest: 20}}}\n"]):
        cohort.write_text("labcrane_cohort: 1\n" + text)
        out = tmp_path / f"data{number}"
        words = ["simulate", str(asking.path), "--participants", "1", "--out", str(out)]
        assert main([*words, "--cohort", str(cohort)]) == 0
        answers = answers_of(find_cohort(out, ["simulated"]).included[0]).set_index("item")
        said.append(answers)
    assert said[1].loc["age", "value"] == 20.0
    for item in ("gender", "handedness", "gaming"):
        pd.testing.assert_series_equal(
            said[0].loc[item, ["value", "text"]], said[1].loc[item, ["value", "text"]]
        )
