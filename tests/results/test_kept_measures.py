"""Measures that are made once and never stale."""

import shutil
from pathlib import Path

import pandas as pd
import pytest

from labcrane.analysis import Participant, measures_of
from labcrane.analysis.cohort import Cohort
from labcrane.analysis.measures import DEFAULTS, MeasureSettings, measure_session
from labcrane.analysis.tables import measure_cache


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
