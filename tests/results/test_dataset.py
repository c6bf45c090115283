"""One Arrow dataset over all participants, and measures that are made once and never stale."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pytest

from labcrane import RecordingError
from labcrane.analysis import Dataset, Participant, measures_of
from labcrane.analysis.cohort import Cohort
from labcrane.analysis.measures import DEFAULTS, MeasureSettings, measure_session
from labcrane.analysis.tables import measure_cache


@pytest.fixture(scope="module")
def dataset(cohort: Cohort) -> Dataset:
    return Dataset(cohort.included)


@pytest.mark.slow
def test_a_trial_is_cut_out_of_the_frames_that_say_they_are_of_it(
    dataset: Dataset, cohort: Cohort
) -> None:
    person = cohort.included[1]
    (number, session), *_ = person.sessions()
    loop, state = session.streams["loop"].data, session.streams["state"]
    for trial in np.random.default_rng().choice(loop["trial"][loop["trial"] > 0].unique(), 2):
        inside = (loop["trial"] == trial).to_numpy()
        table = pa.table(dataset[person.name, number, int(trial)])
        assert set(table["participant"].to_pylist()) == {person.name}
        assert set(table["trial"].to_pylist()) == {int(trial)}
        np.testing.assert_array_equal(table["time"], state.time[inside])
        np.testing.assert_array_equal(
            table["state.tip.position.x"], state.data["tip.position.x"][inside]
        )


def test_arrow_filters_everybody_at_once(dataset: Dataset, cohort: Cohort) -> None:
    chosen = dataset[:, 1].select("state.tip.position.z")
    scanner = ds.Scanner.from_batches(
        chosen.reader(), filter=pc.field("trial") == 2, columns=["participant", "trial"]
    )
    counts = {
        person.name: int((session.streams["loop"].data["trial"] == 2).sum())
        for person in cohort.included
        for _, session in person.sessions()
    }
    assert scanner.to_table().to_pandas()["participant"].value_counts().to_dict() == counts


def test_what_is_not_there_is_said_with_what_is(dataset: Dataset) -> None:
    with pytest.raises(RecordingError, match=r"no participant 'P009'; it has P001, P002"):
        dataset["P009"]
    with pytest.raises(RecordingError, match="no selected participant has session 7"):
        dataset["P001", 7]
    with pytest.raises(RecordingError, match=r"no column 'boom'; it has participant, session"):
        dataset.select("boom")
    with pytest.raises(RecordingError, match=r"slice.* selects a range; give one name or number"):
        dataset["P001", 1, 1:3]
    with pytest.raises(RecordingError, match=r"'1' is not the number of a session or trial"):
        dataset["P001", "1"]


@pytest.fixture
def person(cohort: Cohort, tmp_path: Path) -> Participant:
    was = cohort.included[0]
    path = tmp_path / was.name / was.path.name
    path.parent.mkdir()
    shutil.copyfile(was.path, path)
    return Participant(was.name, path, was.status, was.why)


def test_kept_measures_are_those_that_were_made(
    person: Participant, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = measures_of(person)
    fresh = pd.concat([measure_session(session) for _, session in person.sessions()])
    pd.testing.assert_frame_equal(first[list(fresh)], fresh.reset_index(drop=True))
    (kept,) = (person.path.parent / measure_cache.FOLDER).iterdir()
    assert person.name.encode() not in kept.read_bytes()
    monkeypatch.setattr("labcrane.analysis.measures.measure_session", None)
    pd.testing.assert_frame_equal(measures_of(person), first)


@pytest.mark.slow
def test_measures_are_made_anew_of_another_file_program_or_setting(
    person: Participant, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def noted(*words: object) -> pd.DataFrame:
        made.append(words)
        return measure_session(*words)

    monkeypatch.setattr("labcrane.analysis.measures.measure_session", noted)
    place = person.path.parent / measure_cache.FOLDER
    for count, change in enumerate(
        (
            lambda: None,
            lambda: person.path.write_bytes(person.path.read_bytes() + b"\0"),
            lambda: monkeypatch.setattr(measure_cache, "program", lambda: "another"),
            lambda: next(place.iterdir()).write_bytes(b"PAR1 torn"),
        ),
        start=1,
    ):
        change()
        table = measures_of(person)
        pd.testing.assert_frame_equal(table, measures_of(person))
        assert len(made) == count
        assert len(list(place.iterdir())) == 1
    measures_of(person, MeasureSettings(hysteresis=2 * DEFAULTS.hysteresis))
    assert len(made) == 5


def test_what_cannot_be_kept_is_made_each_time(
    person: Participant, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure_cache.os, "access", lambda *_: False)
    pd.testing.assert_frame_equal(measures_of(person), measures_of(person))
    assert not (person.path.parent / measure_cache.FOLDER).exists()
