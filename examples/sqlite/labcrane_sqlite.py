"""Export all recordings to one SQLite database."""

import json
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

from labcrane import Offer, Settings, hookimpl, offer
from labcrane.analysis import Exporter, Participant

labcrane_api = 1


class SqliteSettings(Settings):
    """Settings of the database: ``labcrane export DATA --to sqlite --set name=study.db``."""

    name: str = "study.db"
    """Name of the database file."""

    ticks: bool = False
    """Whether to add a row with the state at every tick; the database gets large."""


class Sqlite(Exporter):
    """Write the tables ``participant``, ``trial``, ``event`` and, on request, ``state``."""

    def __init__(self, settings: SqliteSettings) -> None:
        self._settings = settings

    def export(self, participants: Iterable[Participant], folder: Path) -> None:
        with closing(sqlite3.connect(folder / self._settings.name)) as database:
            database.executescript(
                "create table participant (name text primary key, status text, why text);"
                "create table event (participant text references participant, session integer,"
                " time real, name text, data text);"
            )
            for participant in participants:
                self._add(database, participant)
                database.commit()

    def _add(self, database: sqlite3.Connection, participant: Participant) -> None:
        about = (participant.name, str(participant.status), participant.why)
        database.execute("insert into participant values (?, ?, ?)", about)
        for number, session in participant.sessions():
            events = session.events
            database.executemany(
                "insert into event values (?, ?, ?, ?, ?)",
                (
                    (participant.name, number, time, name, json.dumps(data))
                    for time, name, data in zip(
                        events["time"], events["name"], events["data"], strict=True
                    )
                ),
            )
            tables = {"trial": session.trials}
            if self._settings.ticks:
                tables["state"] = session.streams["state"].data
            for name, table in tables.items():
                of = {"participant": participant.name, "session": number}
                _append(database, name, table.assign(**of))


def _append(database: sqlite3.Connection, name: str, table) -> None:
    """Append a pandas table and add new columns, because tasks have different columns."""
    rows = database.execute(f'select name from pragma_table_info("{name}")')
    if known := {column for (column,) in rows}:
        for column in table.columns:
            if column not in known:
                database.execute(f'alter table "{name}" add column "{column}"')
    table.to_sql(name, database, if_exists="append", index=False)


@hookimpl
def labcrane_exporters() -> list[Offer[Exporter]]:
    return [offer("sqlite", SqliteSettings, Sqlite)]
