"""BIDS: what the validator finds, and what it misses."""

import gzip
import io
import json
import re
import shutil
from pathlib import Path
from random import Random

import numpy as np
import pandas as pd
import pytest
from needs import needs

from labcrane import ProtocolError
from labcrane.analysis import find_cohort, measures_of
from labcrane.analysis.cohort import Cohort
from labcrane.testing import ch8, plan_session
from labcrane_bids.bids import Bids
from labcrane_bids.files import EntityLabels
from labcrane_bids.settings import BidsSettings
from results.consumers import bids_errors, under
from results.recorded import STUDY, record, study

NAME = "sub-P001_ses-01_task-acquisition"
MOTION = f"sub-P001/ses-01/motion/{NAME}"


@pytest.fixture(scope="module")
def folder(cohort: Cohort, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("bids")
    people = root / "people.csv"
    people.write_text("participant,age,sex,handedness\nP001,24,F,R\n", encoding="utf-8")
    (root / "asked").mkdir()
    (root / "asked" / "tlx.csv").write_text(
        "participant,mental\nP001,35\nP002,40\n", encoding="utf-8"
    )
    about = {"MeasurementToolMetadata": {"Description": "NASA-TLX"}, "mental": {"Units": "1"}}
    (root / "asked" / "tlx.json").write_text(json.dumps(about), encoding="utf-8")
    settings = BidsSettings(
        ethics=("Ethics board, 2026-17",),
        authors=("A. Researcher",),
        license="CC0-1.0",
        people=people,
        phenotype=root / "asked",
    )
    out = root / "out"
    out.mkdir()
    Bids(settings, ch8()).export(iter(cohort.included), out)
    return out


validated = needs("bids-validator-deno")


@pytest.mark.slow
@validated
def test_the_validator_reports_no_error(folder: Path) -> None:
    assert bids_errors(folder) == []


@pytest.mark.slow
@validated
def test_the_validator_does_find_errors(folder: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(folder, broken)
    (broken / f"{MOTION}_tracksys-crane_motion.json").unlink()
    events = broken / f"{MOTION}_events.tsv"
    about = events.with_suffix(".json")
    about.write_text(
        about.read_text(encoding="utf-8").replace("Experiment-structure", "No-such-tag"),
        encoding="utf-8",
    )
    found = " ".join(bids_errors(broken))
    assert "SIDECAR" in found or "MISSING" in found
    assert "HED_ERROR" in found


@pytest.mark.slow
@pytest.mark.parametrize("system", ["crane", "joyL", "joyR"])
def test_what_the_validator_misses(folder: Path, cohort: Cohort, system: str) -> None:
    channels = pd.read_csv(folder / f"{MOTION}_tracksys-{system}_channels.tsv", sep="\t")
    required = ["name", "component", "type", "tracked_point", "units"]
    assert list(channels) == required
    motion = (folder / f"{MOTION}_tracksys-{system}_motion.tsv").read_text(encoding="utf-8")
    first = motion.splitlines()[0].split("\t")
    assert len(first) == len(channels)
    assert all(np.isfinite(float(value)) for value in first)  # no header row
    samples = np.loadtxt(io.StringIO(motion))
    about = json.loads(
        (folder / f"{MOTION}_tracksys-{system}_motion.json").read_text(encoding="utf-8")
    )
    assert about["MotionChannelCount"] == samples.shape[1]
    counted = {kind: about[f"{kind}ChannelCount"] for kind in set(channels["type"])}
    assert counted == channels["type"].value_counts().to_dict()
    assert about["SamplingFrequency"] == 120.0
    assert about["SamplingFrequencyEffective"] == pytest.approx(120.0, rel=1e-6)
    _, session = next(cohort.included[0].sessions())
    recorded = session.streams["state" if system == "crane" else "input"]
    for name, values in zip(channels["name"][1:], samples.T[1:], strict=True):
        np.testing.assert_array_equal(values, recorded.data[name])
    units = channels.set_index("name")["units"]
    if system == "crane":
        assert units[["tip.position.x", "tip.velocity.z", "joint.angle.slew"]].tolist() == [
            "m",
            "m/s",
            "rad",
        ]
        assert channels.set_index("name")["type"]["joint.angle.slew"] == "JNTANG"
    assert units["latency"] == "s"


@pytest.mark.slow
def test_events_are_seconds_from_the_first_sample(folder: Path, cohort: Cohort) -> None:
    events = pd.read_csv(folder / f"{MOTION}_events.tsv", sep="\t", na_values="n/a")
    measured = measures_of(cohort.included[0])
    starts = events[(events["trial_type"] == "trial_start") & (events["counted"] == 1)]
    for value in ("distance", "pair", "far_side", "block"):
        assert starts[value].to_list() == measured[value].to_list()
    np.testing.assert_allclose(starts["response_time"], measured["reaction_time"])
    np.testing.assert_allclose(starts["onset"], measured["started"] - 100.0, atol=1e-9)
    np.testing.assert_allclose(starts["duration"], measured["ended"] - measured["started"])
    about = json.loads((folder / f"{MOTION}_events.json").read_text(encoding="utf-8"))
    tags = about["trial_type"]["HED"]
    assert "(Move, Machine)" in tags["movement_onset"]
    assert set(tags) == set(about["trial_type"]["Levels"]) == set(events["trial_type"])


@pytest.mark.slow
def test_dates_move_and_intervals_stay(folder: Path, cohort: Cohort, tmp_path: Path) -> None:
    scans = pd.read_csv(folder / "sub-P001" / "ses-01" / "sub-P001_ses-01_scans.tsv", sep="\t")
    assert set(scans["acq_time"].str[:10]) == {"1925-01-01"}
    assert all((folder / "sub-P001" / "ses-01" / name).is_file() for name in scans["filename"])
    Bids(BidsSettings(shift_dates=False, every=3), ch8()).export(cohort.included[:1], tmp_path)
    kept = pd.read_csv(tmp_path / "sub-P001" / "ses-01" / "sub-P001_ses-01_scans.tsv", sep="\t")
    started = cohort.included[0].context["started"]
    assert kept["acq_time"][0][:23] == started[:23]
    about = json.loads(
        (tmp_path / f"{MOTION}_tracksys-crane_motion.json").read_text(encoding="utf-8")
    )
    assert about["SamplingFrequency"] == 40.0


@pytest.mark.slow
def test_eye_tracking_is_physio_with_its_columns_described(folder: Path, cohort: Cohort) -> None:
    path = folder / "sub-P001" / "ses-01" / "beh" / f"{NAME}_recording-eye1_physio"
    about = json.loads(path.with_name(f"{path.name}.json").read_text(encoding="utf-8"))
    assert about["PhysioType"] == "eyetrack"
    assert about["Columns"] == ["timestamp", "x_coordinate", "y_coordinate", "aoi"]
    assert set(about["Columns"]) <= set(about)
    text = gzip.decompress(path.with_name(f"{path.name}.tsv.gz").read_bytes())
    samples = np.loadtxt(io.BytesIO(text))
    _, session = next(cohort.included[0].sessions())
    eyes = session.streams["eyes"]
    np.testing.assert_allclose(samples[:, 0], eyes.time - 100.0, atol=1e-9)
    np.testing.assert_array_equal(samples[:, 1], eyes.data["x"])
    by_header = about["StartTime"] + np.arange(len(samples)) / about["SamplingFrequency"]
    np.testing.assert_allclose(by_header, samples[:, 0], atol=1e-9)


@pytest.mark.slow
def test_people_ethics_and_questionnaires_are_where_bids_wants_them(folder: Path) -> None:
    people = pd.read_csv(folder / "participants.tsv", sep="\t", keep_default_na=False)
    assert people.iloc[0].tolist() == ["sub-P001", "24", "F", "R", "n/a", "complete"]
    assert people.iloc[1].tolist() == ["sub-P002", "n/a", "n/a", "n/a", "n/a", "complete"]
    about = json.loads((folder / "dataset_description.json").read_text(encoding="utf-8"))
    assert about["EthicsApprovals"] == ["Ethics board, 2026-17"]
    assert about["BIDSVersion"] == "1.11.1"
    tlx = (folder / "phenotype" / "tlx.tsv").read_text(encoding="utf-8")
    assert tlx.splitlines()[1] == "sub-P001\t35"
    assert "phenotype/tlx.json" in under(folder)


@pytest.mark.slow
def test_the_group_of_the_design_is_in_the_table_of_people(tmp_path: Path) -> None:
    text = STUDY.replace("design:\n", "design:\n  groups: {none: [], slow: []}\n")
    grouped = study(tmp_path, text.replace("movements: 2", "movements: 1"))
    expected = {}
    for name in ("P001", "P002", "P003"):
        record(grouped, tmp_path / "data", name)
        expected[f"sub-{name}"] = plan_session(grouped, name, 1).group
    assert set(expected.values()) == {"none", "slow"}
    out = tmp_path / "out"
    out.mkdir()
    Bids(BidsSettings(), ch8()).export(find_cohort(tmp_path / "data").included, out)
    people = pd.read_csv(out / "participants.tsv", sep="\t", keep_default_na=False)
    assert dict(zip(people["participant_id"], people["group"], strict=True)) == expected


@pytest.mark.slow
def test_missing_files_of_people_are_named(cohort: Cohort, tmp_path: Path) -> None:
    gone = BidsSettings(people=tmp_path / "gone.csv")
    with pytest.raises(ProtocolError, match=r"there is no file .*gone\.csv with age, sex"):
        Bids(gone, ch8()).export(cohort.included, tmp_path)
    (tmp_path / "out").mkdir()
    empty = BidsSettings(phenotype=tmp_path / "out")
    with pytest.raises(ProtocolError, match=r"there is no CSV file in .*; put one there for each"):
        Bids(empty, ch8()).export(cohort.included[:1], tmp_path / "out")


@pytest.mark.parametrize(
    ("table", "description", "words"),
    [
        ("person,score\nP001,35\n", "{}", "has no column 'participant'; its columns are person, "),
        ("participant,score\nP001,35\n", "{", "tlx.json is not valid JSON: .*; correct the file"),
        ("participant,score\nP001,35\n", "[]", "tlx.json holds list; it must hold an object"),
    ],
)
def test_questionnaires_that_cannot_be_taken_over_are_refused_in_words(
    table: str, description: str, words: str, tmp_path: Path
) -> None:
    asked, out = tmp_path / "asked", tmp_path / "out"
    asked.mkdir()
    out.mkdir()
    (asked / "tlx.csv").write_text(table, encoding="utf-8")
    (asked / "tlx.json").write_text(description, encoding="utf-8")
    with pytest.raises(ProtocolError, match=words):
        Bids(BidsSettings(phenotype=asked), ch8()).export([], out)


def test_a_table_of_people_without_pseudonyms_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "people.csv").write_text("", encoding="utf-8")
    people = BidsSettings(people=tmp_path / "people.csv")
    with pytest.raises(ProtocolError, match="has no column 'participant'; its columns are none"):
        Bids(people, ch8()).export([], tmp_path)


ALIKE = (
    "Bio EDA",
    "Bio_EDA",
    "bioEDA",
    "Polar H10 12",
    "Polar H1 012",
    "心電図",
    "脈拍",
    "eye1",
    "+",
)


@needs("bids-validator-deno")
@pytest.mark.slow
def test_streams_of_names_that_look_alike_are_files_of_their_own(tmp_path: Path) -> None:
    record(study(tmp_path), tmp_path / "data", "P001", gaze=True, others=ALIKE)
    out = tmp_path / "out"
    out.mkdir()
    Bids(BidsSettings(), ch8()).export(find_cohort(tmp_path / "data").included, out)
    found = {}
    for path in out.rglob("*_physio.json"):
        about = json.loads(path.read_text(encoding="utf-8"))
        samples = np.loadtxt(path.with_suffix(".tsv.gz"))
        found[about["Description"].removeprefix("LSL stream ")] = set(samples[:, -1])
    assert found.pop("eyes") == {0.0, 1.0}
    assert found == {name: {number} for number, name in enumerate(ALIKE)}
    assert bids_errors(out) == []


@pytest.mark.parametrize("seed", range(20))
def test_every_name_has_a_label_of_its_own_and_keeps_it(seed: int) -> None:
    random = Random(seed)
    names = ["".join(random.choices("aAbB1 _-.é心", k=random.randint(1, 3))) for _ in range(200)]
    labels = EntityLabels()
    given = {name: labels(name) for name in names}
    assert all(re.fullmatch("[A-Za-z0-9]+", label) for label in given.values())
    assert len({label.lower() for label in given.values()}) == len(given)
    assert all(labels(name) == label for name, label in given.items())
