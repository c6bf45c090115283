"""Answers and scores as tables, in every export, read by pandas, R and the BIDS validator."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from governed import GOVERNED, Lab
from needs import needs

from labcrane import open_recording
from labcrane.analysis import answers_of, find_cohort, scores_of
from labcrane.analysis.cohort import Cohort
from labcrane.testing import main, run
from results.answering import Answering
from results.consumers import r

STUDY = GOVERNED.replace(
    "sessions:",
    """questionnaires:
  comfort:
    use: free
    title: Comfort
    questions:
      - {name: heat, text: 'Too hot?'}
      - {name: hand, text: 'Which hand?', kind: choice, choices: [left, right]}
      - {name: why, text: 'Why?', kind: text, required: false}
    sums: {discomfort: [heat]}
  accuracy: {use: subjective_accuracy, language: de}
sessions:""",
).replace(
    "- block: {task: aiming, pairs: 1}",
    "- questionnaire: comfort\n"
    "      - block: {task: aiming, pairs: 1, ask: [accuracy]}\n"
    "      - questionnaire: nasa_tlx",
)
TLX = {"mental": 10, "physical": 20, "temporal": 30, "performance": 40, "effort": 50}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lab = Lab(tmp_path_factory.mktemp("asked"), STUDY)
    lab.approve()
    full = {
        "comfort": {"heat": 7, "hand": "left"},
        "accuracy": {"rating": 8},
        "nasa_tlx": {**TLX, "frustration": 60},
    }
    declining = {
        "comfort": {"heat": None, "hand": "right", "why": 'a "quote", and\na line'},
        "accuracy": {"rating": 3},
        "nasa_tlx": {"mental": 95},
    }
    for name, answers, leaves in (("P001", full, ""), ("P002", declining, "nasa_tlx")):
        lab.consent(name)
        run(lab.visit(name, fast=True), Answering(answers, leaves))
    return lab.places.root


@pytest.fixture(scope="module")
def cohort(data: Path) -> Cohort:
    return find_cohort(data, ["half-finished"])


def answers(cohort: Cohort) -> pd.DataFrame:
    return pd.concat([answers_of(person) for person in cohort.included], ignore_index=True)


def check_answers(table: pd.DataFrame) -> None:
    """Compare with what was answered above, in any program's words for what is missing."""
    table = table.astype({"value": float})
    rows = {
        (row.participant, row.questionnaire, row.item): row for row in table.itertuples(index=False)
    }
    said = rows["P001", "comfort", "heat"]
    assert (said.value, said.step, said.session, said.block) == (7.0, 1, 1, 0)
    assert rows["P001", "comfort", "hand"].text == "left"
    assert rows["P001", "comfort", "why"].missing == "not answered"
    assert rows["P002", "comfort", "heat"].missing == "declined"
    assert np.isnan(rows["P002", "comfort", "heat"].value)
    assert "".join(str(rows["P002", "comfort", "why"].text).split()) == 'a"quote",andaline'
    rated = rows["P001", "accuracy", "rating"]
    assert (rated.value, rated.language, rated.block) == (8.0, "de", 1)
    assert rated.trial >= 1
    assert rows["P002", "nasa_tlx", "mental"].value == 95.0
    assert rows["P002", "nasa_tlx", "effort"].missing == "questionnaire not handed in"
    for item, value in TLX.items():
        assert rows["P001", "nasa_tlx", item].value == value
    assert rows["P001", "nasa_tlx", "mental"].version.startswith("nasa_tlx questionnaires ")
    assert rated.time > said.time


@pytest.mark.slow
def test_there_is_one_row_for_each_answer_and_each_question_without_one(cohort: Cohort) -> None:
    table = answers(cohort)
    check_answers(table)
    asked = table.groupby(["participant", "questionnaire"]).size()
    assert asked["P001", "comfort"] == asked["P002", "comfort"] == 3
    assert asked["P001", "nasa_tlx"] == asked["P002", "nasa_tlx"] == 6
    missing = table["missing"] != ""
    assert (table["value"].notna() | (table["text"] != "")).eq(~missing).all()


@pytest.mark.slow
def test_there_is_one_row_for_each_score_or_why_there_is_none(cohort: Cohort) -> None:
    table = pd.concat([scores_of(person) for person in cohort.included])
    rows = {(row.participant, row.questionnaire, row.score): row for row in table.itertuples()}
    assert rows["P001", "comfort", "discomfort"].value == 7.0
    raw = [row for key, row in rows.items() if key[:2] == ("P001", "nasa_tlx") and "raw" in key[2]]
    assert [row.value for row in raw] == [pytest.approx(np.mean([*TLX.values(), 60]))]
    assert np.isnan(rows["P002", "comfort", "discomfort"].value)
    assert rows["P002", "comfort", "discomfort"].missing == "not answered"


@pytest.mark.slow
def test_older_recordings_have_rows_for_what_was_answered(cohort: Cohort) -> None:
    person = cohort.included[0]
    _, session = next(person.sessions())
    held = open_recording(person.path).session(1).questionnaires
    own = answers_of(person)
    given = own[own["missing"] == ""]
    assert sorted(given["item"]) == sorted(held.loc[held["kind"] == "answer", "item"])
    assert "questionnaires" in session.context  # which older recordings lack


@pytest.fixture(scope="module")
def exports(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("exports")
    for to in ("tables", "psychds", "matlab", "bids"):
        words = ["export", str(data), "--to", to, "--out", str(out / to)]
        assert main([*words, "--include", "half-finished"]) == 0
    return out


@pytest.mark.slow
def test_pandas_reads_the_answers_from_csv_and_parquet(exports: Path) -> None:
    for table in (
        pd.read_csv(exports / "tables" / "questionnaires.csv", keep_default_na=False,
                    na_values={"value": [""], "trial": [""]}),
        pd.read_parquet(exports / "tables" / "questionnaires.parquet"),
    ):  # fmt: skip
        check_answers(table)
    scores = pd.read_csv(exports / "tables" / "scores.csv")
    assert set(scores["questionnaire"]) == {"comfort", "accuracy", "nasa_tlx"}
    files = sorted((exports / "psychds" / "data").glob("*_desc-questionnaires_data.csv"))
    read = [
        pd.read_csv(path, keep_default_na=False, na_values={"value": [""], "trial": [""]})
        for path in files
    ]
    check_answers(pd.concat(read))


@pytest.mark.slow
def test_every_question_is_in_the_codebook_and_every_column_in_psych_ds(exports: Path) -> None:
    book = pd.read_csv(exports / "tables" / "codebook.csv").set_index(["table", "column"])
    for name in ("questionnaires", "scores"):
        columns = pd.read_csv(exports / "tables" / f"{name}.csv").columns
        assert set(columns) <= set(book.loc[name].index)
    said = book.loc[("questionnaires.item", "comfort_heat"), "description"]
    assert said == "Too hot? (0 to 10 in steps of 1)"
    about = json.loads(
        (exports / "psychds" / "dataset_description.json").read_text(encoding="utf-8")
    )
    described = {each["name"] for each in about["variableMeasured"]}
    for path in (exports / "psychds" / "data").glob("*.csv"):
        assert set(pd.read_csv(path).columns) <= described


@pytest.mark.slow
def test_what_was_answered_after_a_trial_is_beside_it(exports: Path) -> None:
    trials = pd.read_csv(exports / "tables" / "trials.csv")
    answers = pd.read_csv(exports / "tables" / "questionnaires.csv")
    after = answers[answers["trial"].notna()]
    assert set(after["questionnaire"]) == {"accuracy"}, "the others are asked between blocks"
    merged = after.merge(trials, on=["participant", "session", "trial"], suffixes=("", "_of"))
    assert len(merged) == len(after) == trials["accuracy_rating"].notna().sum()
    np.testing.assert_array_equal(merged["value"], merged["accuracy_rating"])
    scores = pd.read_csv(exports / "tables" / "scores.csv").query("trial.notna()")
    assert scores["value"].tolist() == trials["accuracy_share"].dropna().tolist()
    book = pd.read_csv(exports / "tables" / "codebook.csv").set_index(["table", "column"])
    assert len(book.loc[("trials", "accuracy_rating"), "description"]) > 10
    assert not any(column.startswith("comfort") for column in trials)


@pytest.mark.slow
@needs("Rscript")
def test_r_reads_the_answers(exports: Path) -> None:
    script = """
    argument <- commandArgs(TRUE)
    table <- read.csv(file.path(argument, "tables", "questionnaires.csv"))
    tlx <- table[table$participant == "P001" & table$questionnaire == "nasa_tlx", ]
    cat(mean(tlx$value), nrow(table), sum(table$missing == "declined"))
    """
    mean, rows, declined = map(float, r(script, exports).split())
    assert mean == pytest.approx(35.0)
    assert rows == len(pd.read_csv(exports / "tables" / "questionnaires.csv"))
    assert declined == 1


@pytest.mark.slow
def test_phenotype_comes_from_the_recording_and_is_described(exports: Path) -> None:
    folder = exports / "bids" / "phenotype"
    tlx = pd.read_csv(folder / "nasatlx.tsv" if (folder / "nasatlx.tsv").exists()
                      else folder / "nasa_tlx.tsv", sep="\t", na_values="n/a")  # fmt: skip
    assert tlx["participant_id"].tolist() == ["sub-P001", "sub-P002"]
    assert tlx["effort"].tolist()[0] == 50.0
    comfort = pd.read_csv(folder / "comfort.tsv", sep="\t", na_values="n/a")
    assert comfort["why"].tolist()[1] == 'a "quote", and a line'
    assert comfort["hand"].tolist() == ["left", "right"]
    assert comfort["missing"].tolist() == ["why: not answered", "heat: declined"]
    about = json.loads((folder / "comfort.json").read_text(encoding="utf-8"))
    assert about["MeasurementToolMetadata"]["Description"] == "Comfort"
    assert about["heat"]["Description"] == "Too hot?"
    assert set(about["hand"]["Levels"]) == {"left", "right"}
    assert set(comfort) - {"participant_id"} <= set(about)
    rating = pd.read_csv(folder / "accuracy.tsv", sep="\t", na_values="n/a")
    assert rating["trial"].notna().all()
