"""Answers of a study that was amended, and of items called as columns of the exports are."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from governed import GOVERNED, TODAY, Lab, edit
from needs import needs
from scipy.io import loadmat

from labcrane.approval.decision import amend
from labcrane.testing import main, run
from results.answering import Answering
from results.consumers import bids_errors, needs_octave, octave, r
from results.test_bids import validated

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("amended")]

STUDY = (
    GOVERNED.replace("movements: 1", "movements: 2")
    .replace(
        "sessions:",
        """questionnaires:
  about: {use: demographics, ask: [age]}
  mood-1: {use: free, title: M, questions: [{name: mood, text: 'Before?'}]}
  mood1: {use: free, title: N, questions: [{name: mood, text: 'After?'}], sums: {all: [mood]}}
  called:
    use: free
    title: Called as columns are
    questions:
      - {name: trial, text: 'Which trial was best?'}
      - {name: block, text: 'Which block?', kind: choice, choices: [first, last]}
      - {name: language, text: 'Which language?', kind: text}
      - {name: score_all, text: 'Of all?'}
      - {name: item_trial, text: 'Which item?'}
    sums: {all: [trial]}
  heat: {use: free, title: Heat, questions: [{name: felt, text: 'Too hot?'}]}
  movement: {use: free, title: M, questions: [{name: time, text: 'How long?'}]}
  a: {use: free, title: A, questions: [{name: b_c, text: 'A?'}]}
  a_b: {use: free, title: B, questions: [{name: c, text: 'B?'}]}
sessions:""",
    )
    .replace(
        "- block: {task: aiming, pairs: 1}",
        """- questionnaire: [about, called, mood-1]
      - block: {task: aiming, pairs: 1, ask: [heat, movement, a, a_b]}
      - questionnaire: mood1""",
    )
)
SCALE, CHOICE = "text: 'Too hot?'}", "text: 'Too hot?', kind: choice, choices: [cold, warm]}"
ORDER = ("[heat, movement, a, a_b]", "[heat, a_b, a, movement]")

GIVEN = {"age": 91, "trial": 7, "block": "last", "language": "Polish", "score_all": 3,
         "item_trial": 5, "time": 9, "b_c": 1, "c": 2}  # fmt: skip
ITEMS = {
    "about": ["age"], "mood-1": ["mood"], "mood1": ["mood"], "heat": ["felt"],
    "called": ["trial", "block", "language", "score_all", "item_trial"],
    "movement": ["time"], "a": ["b_c"], "a_b": ["c"],
}  # fmt: skip
MOODS = {"mood-1": 4, "mood1": 8}
FELT = {"P001": 4, "P002": "warm", "P003": "cold"}


def answers(felt: object) -> dict[str, dict[str, object]]:
    """Return an answer to every item that is asked."""
    return {
        name: {item: (GIVEN | {"felt": felt, "mood": MOODS.get(name)})[item] for item in items}
        for name, items in ITEMS.items()
    }


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One person before an amendment and two after it, exported to every table."""
    lab = Lab(tmp_path_factory.mktemp("amended"), STUDY)
    lab.approve()
    for name, felt in FELT.items():
        if name == "P002":
            edit(lab.protocol, SCALE, CHOICE)
            edit(lab.protocol, *ORDER)
            amend(lab.study, lab.registry, lab.grant(), "words are easier", TODAY)
        lab.consent(name)
        run(lab.visit(name, fast=True), Answering(answers(felt)))
    for to in ("tables", "psychds", "matlab", "bids"):
        out = str(lab.folder / "exports" / to)
        assert main(["export", str(lab.places.root), "--to", to, "--out", out]) == 0
    return lab.folder / "exports"


def tsv(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, sep="\t", na_values=["n/a"], keep_default_na=False, dtype=str)


def test_an_item_called_as_a_column_leaves_that_column_as_it_is(exports: Path) -> None:
    folder = exports / "bids" / "phenotype"
    called = tsv(folder / "called.tsv")
    assert called["item_trial"].astype(float).tolist() == [7.0] * 3
    assert called["item_block"].tolist() == ["last"] * 3
    assert called["item_language"].tolist() == ["Polish"] * 3
    assert called["item_score_all"].astype(float).tolist() == [3.0] * 3
    assert called["item_item_trial"].astype(float).tolist() == [5.0] * 3
    assert called["score_all"].astype(float).tolist() == [7.0] * 3
    assert called["trial"].isna().all(), "it was asked before the first"
    assert called["block"].tolist() == ["0"] * 3
    about = json.loads((folder / "called.json").read_text(encoding="utf-8"))
    assert about["item_trial"]["Description"] == "Which trial was best?"
    assert about["trial"]["Description"].startswith("trial that it follows")
    assert set(called) - {"participant_id"} == set(about) - {"MeasurementToolMetadata"}


def test_questionnaires_of_alike_names_have_a_table_each(exports: Path) -> None:
    folder = exports / "bids" / "phenotype"
    first, second = tsv(folder / "mood1.tsv"), tsv(folder / "mood1x2.tsv")
    assert first["mood"].astype(float).tolist() == [4.0] * 3
    assert second["mood"].astype(float).tolist() == [8.0] * 3
    assert second["score_all"].astype(float).tolist() == [8.0] * 3
    about = json.loads((folder / "mood1.json").read_text(encoding="utf-8"))
    assert about["MeasurementToolMetadata"]["Description"] == "M"
    assert about["mood"]["Description"].startswith("Before?")


def test_an_age_that_leads_to_a_person_is_in_no_table_of_bids(exports: Path) -> None:
    people = tsv(exports / "bids" / "participants.tsv")
    asked = tsv(exports / "bids" / "phenotype" / "about.tsv")
    assert people["age"].tolist() == asked["age"].tolist() == ["89+"] * 3


def test_an_amended_item_says_who_was_asked_what(exports: Path) -> None:
    about = json.loads((exports / "bids" / "task-heat_beh.json").read_text(encoding="utf-8"))
    said = about["felt"]["Description"]
    assert "of sub-P001_ses-01: Too hot? [0 to 10]" in said
    assert "of sub-P002_ses-01, sub-P003_ses-01: Too hot? [cold, warm]" in said
    assert "Levels" not in about["felt"], "a 4 is none of them"


@validated
def test_the_bids_validator_finds_no_error(exports: Path) -> None:
    assert bids_errors(exports / "bids") == []


def test_pandas_reads_numbers_and_words_of_an_amended_item(exports: Path) -> None:
    for trials in (
        pd.read_csv(exports / "tables" / "trials.csv"),
        pd.read_parquet(exports / "tables" / "trials.parquet"),
    ):
        last = trials.groupby("participant").last()
        assert last["heat_felt"].to_dict() == {name: str(felt) for name, felt in FELT.items()}


def test_a_column_means_the_same_for_everyone(exports: Path) -> None:
    trials = pd.read_csv(exports / "tables" / "trials.csv")
    alone = [
        pd.read_csv(path) for path in (exports / "psychds" / "data").glob("*session-1_data.csv")
    ]
    people = [loadmat(path, simplify_cells=True)["labcrane"] for path in
              sorted((exports / "matlab").glob("*.mat"))]  # fmt: skip
    assert len(alone) == len(people) == 3
    for table in (trials, *alone, *(pd.DataFrame(each["trials"]) for each in people)):
        rated = table[table["a_b_c"].notna()]
        assert len(rated) >= 2
        assert (rated["a_b_c"] == 1).all(), "item b_c of questionnaire a"
        assert (rated["a_b_c_2"] == 2).all(), "item c of questionnaire a_b"
        assert (rated["movement_time_2"] == 9).all()
        assert not np.isclose(rated["movement_time"], 9).any()
    book = pd.read_csv(exports / "tables" / "codebook.csv").query("table == 'trials'")
    told = book.set_index("column")["description"]
    asked = {"a_b_c": "A?", "a_b_c_2": "B?", "movement_time_2": "How long?"}
    for column, text in asked.items():
        assert told[column] == f"{text} (0 to 10 in steps of 1)"
    assert set(told.index) == set(trials)


@needs_octave
def test_octave_reads_an_amended_study_and_warns(exports: Path) -> None:
    said = octave(
        """addpath(argument); s = read_labcrane(argument);
        printf('%s|%s\\n', lastwarn, strjoin(unique(s.trials.heat_felt)', ','));""",
        exports / "matlab",
    )
    assert "heat_felt is words of some participants and numbers of others, as P002 shows" in said
    assert ",4,cold,warm" in said or "|4,cold,warm" in said


@needs("Rscript")
def test_r_reads_an_amended_study(exports: Path) -> None:
    script = """argument <- commandArgs(TRUE); source(file.path(argument, "read.R"))
    study <- suppressWarnings(read_labcrane(argument))
    cat(sort(unique(na.omit(as.character(study$trials$heat_felt)))))"""
    assert r(script, exports / "tables").split()[-3:] == ["4", "cold", "warm"]
