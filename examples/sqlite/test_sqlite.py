"""The database holds what the recordings hold; asked with SQL."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from labcrane_sqlite import Sqlite, SqliteSettings

from labcrane.analysis import Exporter
from labcrane.testing import ExporterContract
from labcrane.testing.exporters import MOVEMENT_S, PARTICIPANT_TRIALS, RATE_HZ, make_participant


class TestSqlite(ExporterContract):
    @pytest.fixture
    def exporter(self) -> Exporter:
        return Sqlite(SqliteSettings())


def test_sql_finds_every_trial_event_and_tick(tmp_path: Path) -> None:
    people = [make_participant(tmp_path, name) for name in ("P001", "P002")]
    out = tmp_path / "out"
    out.mkdir()
    Sqlite(SqliteSettings(name="lab.db", ticks=True)).export(people, out)
    with closing(sqlite3.connect(out / "lab.db")) as database:

        def ask(question: str) -> list[tuple[object, ...]]:
            return database.execute(question).fetchall()

        assert ask("select name, status from participant") == [
            ("P001", "complete"),
            ("P002", "complete"),
        ]
        assert ask(
            "select participant, count(*), sum(movement_time) from trial group by participant"
        ) == [
            (name, PARTICIPANT_TRIALS, pytest.approx(PARTICIPANT_TRIALS * (MOVEMENT_S - 0.2)))
            for name in ("P001", "P002")
        ]
        assert ask("select count(*) from event where name = 'trial.end'") == [
            (2 * PARTICIPANT_TRIALS,)
        ]
        assert ask("select count(*) from state where participant = 'P002'") == [
            (PARTICIPANT_TRIALS * MOVEMENT_S * RATE_HZ,)
        ]
