"""Unlike people through every exporter, to the programs that read it."""

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat

import labcrane
from labcrane.analysis import measures_of
from labcrane.approval.codebook import codebook
from labcrane.testing import main
from results.awkward import ANSWERS, FORMULA, HALF_FINISHED, NULL, Awkward
from results.consumers import bids_errors, needs_octave, octave, table
from results.test_bids import validated

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("awkward")]

OCTAVE = """
addpath(argument); s = read_labcrane(argument);
number = @(x) sprintf('%.17g', x);
row = @(name, values) printf('%s|%s\\n', name, strjoin(cellfun(number, num2cell(values), ...
    'UniformOutput', false)', '|'));
row('time', s.trials.movement_time); row('rating', s.trials.accuracy_rating);
row('load', s.questionnaires.value(strcmp(s.questionnaires.item, 'mental')));
row('raw', s.scores.value(strcmp(s.scores.score, 'raw')));
printf('who|%s\\n', strjoin(s.trials.participant', '|'));
printf('group|%s\\n', strjoin(s.trials.group', '|'));
printf('why|%s\\n', strjoin(s.questionnaires.text(strcmp(s.questionnaires.item, 'why'))', '|'));
"""


@needs_octave
def test_octave_reads_unlike_people_in_one_call(awkward: Awkward) -> None:
    said = table(octave(OCTAVE, awkward.export("matlab")))
    measured = pd.concat(measures_of(person) for person in awkward.cohort.included)
    np.testing.assert_array_equal(np.array(said["time"], float), measured["movement_time"])
    assert said["who"] == measured["participant"].tolist()
    assert set(said["group"]) == {"no tone", "loud"}
    given = list(zip(said["who"], map(float, said["rating"]), strict=True))
    rated = {name for name, rating in given if not np.isnan(rating)}
    assert rated == set(ANSWERS) - {HALF_FINISHED}
    assert all(rating == ANSWERS[name]["rating"] for name, rating in given if not np.isnan(rating))
    assert np.array(said["load"], float).tolist() == [10, 20, 20, 40, 30, 40, 80]
    assert said["raw"] == said["load"]
    assert said["why"][:2] == [FORMULA, NULL]


@needs_octave
def test_octave_refuses_people_of_two_studies(awkward: Awkward, tmp_path: Path) -> None:
    for name in ("P001.mat", "read_labcrane.m"):
        shutil.copy(awkward.export("matlab") / name, tmp_path)
    other = loadmat(tmp_path / "P001.mat")["labcrane"]
    other["study"][0, 0] = np.array(["another"])
    savemat(tmp_path / "Q001.mat", {"labcrane": other}, long_field_names=True)
    caught = "try; read_labcrane(argument); catch e; disp(e.message); end"
    said = octave(f"addpath(argument); {caught}", tmp_path)
    assert "P001 is of the study 'rehearsal' and P001 of 'another'; read each study" in said


def test_a_result_has_one_definition_wherever_it_is_read(
    awkward: Awkward, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    task = awkward.lab.study.tasks["aiming"]
    defined = {signal.name: signal.definition for signal in (*task.conditions, *task.results)}
    assert "movement time of Dreger et al." in defined["circle_to_circle"]
    book = pd.read_csv(awkward.export("tables") / "codebook.csv").query("table == 'trials'")
    told = book.set_index("column")["description"].to_dict()
    assert defined == {name: told[name] for name in defined}
    approved = {each.name: each.definition for each in codebook(awkward.lab.study)}
    assert defined == {name: approved[name] for name in defined}
    with h5py.File(awkward.data / "P001" / "P001.h5") as file:
        trials = file["ses-01/trials"]
        assert defined == {name: trials[name].attrs["definition"] for name in defined}
    described = json.loads((awkward.export("psychds") / "dataset_description.json").read_text(
        encoding="utf-8"))["variableMeasured"]  # fmt: skip
    told = {each["name"]: each["description"].rpartition("; ")[0] for each in described}
    assert defined.items() <= told.items()
    listed = pd.read_csv(awkward.report() / "tables" / "definitions.csv").set_index("measure")
    assert defined.items() <= listed["meaning"].to_dict().items()
    capsys.readouterr()
    assert main(["plugins", "show", "aiming", "--json"]) == 0
    (shown,) = json.loads(capsys.readouterr().out)
    said = {each["column"]: each["definition"] for each in shown["recorded"]}
    assert defined.items() <= said.items()
    reference = (Path(labcrane.__file__).parents[1] / "docs" / "reference" / "task.md").read_text(
        encoding="utf-8")  # fmt: skip
    assert all(definition in reference for definition in defined.values())


@validated
def test_the_bids_validator_finds_no_error(awkward: Awkward) -> None:
    assert bids_errors(awkward.export("bids")) == []


def answers_in(path: Path) -> pd.DataFrame:
    return pd.read_csv(path, sep="\t", na_values=["n/a"], keep_default_na=False)


def test_bids_has_each_answer_with_its_trial(awkward: Awkward) -> None:
    folder = awkward.export("bids")
    for name, given in ANSWERS.items():
        beh = folder / f"sub-{name}" / "ses-01" / "beh"
        loads = answers_in(beh / f"sub-{name}_ses-01_task-nasatlx_beh.tsv")
        load = 10 * int(name[-1])
        assert loads["mental"].tolist() == ([load] if name == HALF_FINISHED else [load, 2 * load])
        assert loads["trial"].isna().all()
        rated = answers_in(beh / f"sub-{name}_ses-01_task-accuracy_beh.tsv")
        if name != HALF_FINISHED:
            trials = measures_of(next(p for p in awkward.cohort.included if p.name == name))
            assert rated["trial"].tolist() == trials.query("session == 1")["trial"].tolist()
            assert rated["rating"].tolist() == [given["rating"]] * len(rated)
    about = json.loads((folder / "task-nasatlx_beh.json").read_text(encoding="utf-8"))
    assert set(loads) <= set(about)
    assert about["TaskDescription"] == "NASA task load index"
    why = answers_in(folder / "phenotype" / "why.tsv").set_index("participant_id")["why"]
    assert why["sub-P001"] == FORMULA
    assert why["sub-P002"] == NULL


def test_recorded_demographics_are_in_the_table_of_people(awkward: Awkward) -> None:
    people = pd.read_csv(awkward.export("bids") / "participants.tsv", sep="\t", dtype=str,
                         keep_default_na=False)  # fmt: skip
    assert people[["age", "sex", "handedness"]].to_numpy().tolist() == [
        ["24", "F", "R"],
        ["31", "M", "A"],
        ["89+", "O", "L"],
        ["n/a", "n/a", "n/a"],
    ]
    about = json.loads((awkward.export("bids") / "participants.json").read_text(encoding="utf-8"))
    assert set(people["sex"]) - {"n/a"} <= set(about["sex"]["Levels"])
