"""Tables that R, pandas and Arrow open, and Psych-DS."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from labcrane.analysis import find_cohort, measures_of
from labcrane.analysis.cohort import Cohort
from labcrane.core import Event
from labcrane.recording.labels import Labels
from labcrane_tables.psychds import PsychDs
from labcrane_tables.settings import PsychDsSettings, TableSettings
from labcrane_tables.tables import Tables
from results.consumers import needs_r, r, table, under
from results.recorded import record, study


@pytest.fixture(scope="module")
def folder(cohort: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("tables")
    Tables(TableSettings(streams="both")).export(iter(cohort.included), out)
    return out


@pytest.mark.slow
def test_pandas_and_arrow_read_what_was_measured(folder: Path, cohort: Cohort) -> None:
    measured = pd.concat([measures_of(person) for person in cohort.included], ignore_index=True)
    for read in (pd.read_csv(folder / "trials.csv"), pd.read_parquet(folder / "trials.parquet")):
        assert list(read) == list(measured)
        for name in ("movement_time", "sparc", "reversals", "dwell_during_1"):
            np.testing.assert_allclose(read[name], measured[name], rtol=1e-15)
    frames = pq.read_table(folder / "streams" / "P001_ses-01_frames.parquet").to_pandas()
    _, session = next(cohort.included[0].sessions())
    state = session.streams["state"]
    np.testing.assert_array_equal(frames["time"], state.time)
    np.testing.assert_array_equal(frames["state_tip_position_x"], state.data["tip.position.x"])
    eyes = pd.read_csv(folder / "streams" / "P002_ses-01_eyes.csv.gz")
    np.testing.assert_allclose(eyes["time"] - eyes["time_raw"], 5000.0, atol=1e-6)


@pytest.mark.slow
def test_columns_of_parquet_are_those_of_csv(folder: Path) -> None:
    for path in (folder / "streams").glob("*.parquet"):
        pd.testing.assert_frame_equal(
            pq.read_table(path).to_pandas(),
            pd.read_csv(path.with_suffix(".csv.gz")),
            check_dtype=False,  # whole numbers have no point in CSV
        )


@pytest.mark.slow
def test_the_codebook_has_every_column_and_the_units_of_the_file(folder: Path) -> None:
    book = pd.read_csv(folder / "codebook.csv").set_index(["table", "column"])
    for name, path in {
        "trials": folder / "trials.csv",
        "events": folder / "events.csv",
        "frames": folder / "streams" / "P001_ses-01_frames.csv.gz",
    }.items():
        assert set(pd.read_csv(path, nrows=1)) == set(book.loc[name].index)
    assert book.loc[("trials", "movement_time"), "unit"] == "s"
    assert book.loc[("trials", "difficulty"), "unit"] == "bit"
    assert book.loc[("frames", "state_tip_velocity_x"), "unit"] == "m/s"
    assert book["description"].notna().all()
    # Of trials, events and the loop every column says more than its name.
    named = book[book["description"] == book.index.get_level_values("column").str.replace("_", " ")]
    assert not set(named.index.get_level_values("table")) & {"trials", "events"}
    assert not [column for _, column in named.index if column.startswith("loop_")]
    assert book.loc[("frames", "loop_phase"), "description"].startswith("0 idle, 1 running, 2 succ")
    assert book.loc[("trials", "outcome"), "description"].startswith("how the trial ended: success")


READ = """
source(file.path(commandArgs(TRUE)[1], "read.R")); s <- read_labcrane(commandArgs(TRUE)[1])
cat("tables", paste(names(s), collapse = " "), "\\n", sep = "|")
cat("streams", paste(sort(names(s$streams)), collapse = " "), "\\n", sep = "|")
cat("time", sprintf("%.17g", s$trials$movement_time), sep = "|"); cat("\\n")
cat("na", sum(is.na(s$trials$movement_time)), sum(is.na(s$streams[[1]]$time)), sep = "|")
cat("\\nslew", sprintf("%.17g", s$streams[["P001_ses-01_frames"]]$state_joint_angle_slew[1000]),
    sep = "|")
cat("\\ntitle", s$participants$status[1], class(s$trials$pair), sep = "|"); cat("\\n")
"""


@needs_r
def test_read_r_says_which_streams_it_cannot_read_and_loads_the_rest(
    cohort: Cohort, tmp_path: Path
) -> None:
    """Streams are Parquet unless CSV is asked for, and R reads that with a package only."""
    Tables(TableSettings()).export(cohort.included[:1], tmp_path)
    hidden = (
        'requireNamespace <- function(...) FALSE; options(warn = 1); sink(stderr(), type = "m")'
    )
    said = table(r(f"{hidden}\n{READ.replace('1000', '1')}", tmp_path))
    assert said["tables"][0] == "codebook events participants questionnaires scores trials streams"
    assert len(said["time"]) == len(measures_of(cohort.included[0]))


@pytest.mark.slow
@needs_r
def test_read_r_loads_everything_in_one_call(folder: Path, cohort: Cohort) -> None:
    said = table(r(READ, folder))
    assert set(said["tables"][0].split()) == {path.stem for path in folder.glob("*.csv")} | {
        "streams"
    }
    assert {"questionnaires", "scores"} <= set(said["tables"][0].split())
    assert said["streams"][0] == (
        "P001_ses-01_eyes P001_ses-01_frames P002_ses-01_eyes P002_ses-01_frames"
    )
    measured = pd.concat([measures_of(person) for person in cohort.included])
    np.testing.assert_allclose(np.array(said["time"], float), measured["movement_time"], rtol=1e-15)
    assert said["na"] == ["0", "0"]
    _, session = next(cohort.included[0].sessions())
    slew = session.streams["state"].data["joint.angle.slew"][999]
    assert float(said["slew"][0]) == pytest.approx(slew, rel=1e-15)
    assert said["title"] == ["complete", "character"]


@pytest.mark.slow
def test_events_are_those_of_the_file_and_the_context_stays_there(
    folder: Path, cohort: Cohort
) -> None:
    events = pd.read_csv(folder / "events.csv")
    parquet = pd.read_parquet(folder / "events.parquet")
    own = [session.events for person in cohort.included for _, session in person.sessions()]
    assert len(events) == len(parquet) == sum(map(len, own))
    np.testing.assert_allclose(events["time"], pd.concat(own)["time"], rtol=1e-15)
    assert events.loc[events["name"] == "session.start", "data"].eq("{}").all()
    for person in cohort.included:
        for number, session in person.sessions():
            mine = events[(events["participant"] == person.name) & (events["session"] == number)]
            sent = Labels()
            told = [
                sent.label(Event(name, 0.0, data))
                for name, data in zip(session.events["name"], session.events["data"], strict=True)
            ]
            assert list(mine["label"]) == told
    assert events["label"].str.fullmatch(r"trial_start/block=.+").any()
    end = events[events["name"] == "trial.end"].iloc[0]
    assert json.loads(end["data"])["outcome"] == "success"


def test_streams_are_written_as_asked(cohort: Cohort, tmp_path: Path) -> None:
    assert TableSettings().streams == "parquet"
    for form, endings in {"parquet": {".parquet"}, "csv": {".gz"}, "none": set()}.items():
        out = tmp_path / form
        out.mkdir()
        Tables(TableSettings(streams=form)).export(cohort.included[:1], out)
        assert {path.suffix for path in (out / "streams").iterdir()} == endings


def test_psych_ds_describes_columns_by_the_names_they_are_written_under(
    cohort: Cohort, tmp_path: Path
) -> None:
    """A task may name its results with dots, as scenarios do; CSV files have underscores."""
    person = cohort.included[0]
    table = measures_of(person).rename(columns={"peak_speed": "Peak.Speed"})
    measured = replace(person, measured=table)
    PsychDs(PsychDsSettings()).export([measured], tmp_path)
    about = json.loads((tmp_path / "dataset_description.json").read_text(encoding="utf-8"))
    (path,) = (tmp_path / "data").iterdir()
    assert set(pd.read_csv(path)) == {each["name"] for each in about["variableMeasured"]}
    assert "peak_speed" in set(pd.read_csv(path))


def test_psych_ds_describes_every_column_of_every_file(cohort: Cohort, tmp_path: Path) -> None:
    """Psych-DS 1.0: names are key-value pairs that end in _data.csv, columns are all described."""
    PsychDs(PsychDsSettings()).export(cohort.included, tmp_path)
    assert under(tmp_path) == [
        "README.md",
        "data/study-results_subject-P001_session-1_data.csv",
        "data/study-results_subject-P002_session-1_data.csv",
        "dataset_description.json",
    ]
    about = json.loads((tmp_path / "dataset_description.json").read_text(encoding="utf-8"))
    assert about["@type"] == "Dataset"
    assert about["name"] == "Übung mit dem Kran"
    described = {variable["name"]: variable for variable in about["variableMeasured"]}
    for path in (tmp_path / "data").iterdir():
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert set(header) == set(described)
        assert len(rows) == 8
    assert described["movement_time"]["unitText"] == "s"


@pytest.mark.slow
def test_files_of_streams_have_names_that_every_disk_takes(tmp_path: Path) -> None:
    """Each name is of another program, and Windows takes none of them as it is."""
    streams = ["EEG: rig 1", "a<b>c|d", 'what? "x*y"', "back\\slash", "con"]
    record(study(tmp_path), tmp_path / "data", "P001", others=streams)
    people = find_cohort(tmp_path / "data").included
    out = tmp_path / "out"
    out.mkdir()
    Tables(TableSettings(streams="csv")).export(iter(people), out)
    names = {path.name.removesuffix(".csv.gz") for path in (out / "streams").iterdir()}
    assert all(re.fullmatch(r"P001_ses-01_[A-Za-z0-9_.-]+", name) for name in names)
    assert len(names) == len(streams) + 1
    book = pd.read_csv(out / "codebook.csv", keep_default_na=False)
    for stream in streams:
        (name,) = set(book["table"][book["source"].str.endswith(f" '{stream}'")])
        assert f"P001_ses-01_{name}" in names
