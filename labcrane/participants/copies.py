"""Copies of participants' data: exports that labcrane made, and the lab's store."""

import csv
import io
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from labcrane.files.atomic import UNFINISHED, write_text
from labcrane.participants.folders import Places
from labcrane.participants.register import Export, Owed, Register, changed
from labcrane.recording.participant_file.relabel import renaming

TABLES = {".csv": ",", ".tsv": "\t"}
"""Exports in which single rows can be taken out, and what separates their cells."""


@dataclass
class Reach:
    """What an operation has done to copies, and what it has not.

    Attributes
    ----------
    changed, removed
        Files, for people.
    owed
        What cannot be reached now: a disk that is not plugged in, a share that is offline.
    """

    changed: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    owed: list[Owed] = field(default_factory=list)


def record_export(
    places: Places,
    exporter: str,
    folder: Path,
    files: Mapping[Path, Iterable[str]],
    today: date,
) -> None:
    """Keep where data went, so that they can be erased and relabelled there.

    Every exporter is to call this once its files are written.

    Parameters
    ----------
    files
        The participants in each file; paths in ``folder``.
    """
    folder, root = folder.resolve(), places.root.resolve()
    inside = folder.is_relative_to(root)  # the data folder may move, and its exports with it
    entry = Export(
        date=today.isoformat(),
        exporter=exporter,
        folder=folder.relative_to(root).as_posix() if inside else str(folder),
        files={
            (folder / path).relative_to(folder).as_posix(): sorted(set(names))
            for path, names in files.items()
        },
    )
    with changed(places) as register:
        register.exports = [
            *(known for known in register.exports if known.folder != entry.folder
              or known.exporter != exporter),
            entry,
        ]  # fmt: skip


def edit_exports(
    places: Places, register: Register, old: str, new: str | None, reach: Reach
) -> None:
    """Take ``old`` out of all exports, or put ``new`` in its place.

    Tables are edited row by row; files of the participant alone are removed, or renamed with
    their tables; what cannot be edited is removed, since it can be exported again. May be
    repeated at any moment.
    """
    for export in register.exports:
        folder = places.root / export.folder
        concerned = {name: people for name, people in export.files.items() if old in people}
        if concerned and not folder.is_dir():
            owed = Owed(participant=old, to=new, folder=str(folder), files=concerned)
            reach.owed.append(owed)
            continue
        for name, people in concerned.items():
            edit_file(folder / name, people, old, new, reach)


def edit_file(path: Path, people: Sequence[str], old: str, new: str | None, reach: Reach) -> None:
    """Take ``old`` out of one exported file, or put ``new`` in its place."""
    beside = path.with_name(f".{path.name}{UNFINISHED}")
    beside.unlink(missing_ok=True)
    if not path.exists():
        return
    separator = TABLES.get(path.suffix)
    own = set(people) == {old}
    if separator is None or (own and new is None):
        path.unlink()
        reach.removed.append(str(path))
        return
    rename = renaming(old, new or "")
    rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8")), delimiter=separator))
    out = io.StringIO()
    writer = csv.writer(out, delimiter=separator, lineterminator="\n")
    for row in rows:
        if new is not None:
            writer.writerow([rename(cell) for cell in row])
        elif all(rename(cell) == cell for cell in row):
            writer.writerow(row)
    write_text(path.with_name(rename(path.name)) if new else path, out.getvalue())
    if new and rename(path.name) != path.name:
        path.unlink()
    reach.changed.append(str(path))


def forget_export(register: Register, old: str, new: str | None) -> None:
    """Bring the list of exports up to what :func:`edit_exports` has done."""
    rename = renaming(old, new or "")
    for export in register.exports:
        files: dict[str, list[str]] = {}
        for name, people in export.files.items():
            table = Path(name).suffix in TABLES
            if old not in people:
                files[name] = people
            elif table and (new or set(people) != {old}):
                rest = [person for person in people if person != old] + ([new] if new else [])
                files[rename(name) if new else name] = sorted(rest)
        export.files = files
    register.exports = [export for export in register.exports if export.files]


def in_store(store: Path, study: str, participant: str) -> Path:
    """Return where a store keeps a participant's recordings."""
    return store / (study or "study") / participant


def remove_from_stores(register: Register, participant: str, reach: Reach) -> None:
    """Remove a participant from every store that is there."""
    for name, files in register.stores.items():
        if not any(file.split("/")[0] == participant for file in files):
            continue
        store = Path(name)
        if not store.is_dir():
            reach.owed.append(Owed(participant=participant, folder=name))
            continue
        folder = in_store(store, register.study, participant)
        if folder.is_dir():
            shutil.rmtree(folder)
            reach.removed.append(str(folder))
