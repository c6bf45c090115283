"""Copies of participants' data: what labcrane wrote of them, the lab's store, and a list of all."""

import csv
import gzip
import io
import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from labcrane.files.atomic import UNFINISHED, replacing, write_text
from labcrane.participants.folders import Places
from labcrane.participants.mentions import Mentions
from labcrane.participants.proof import mentioned
from labcrane.participants.register import Export, OwedRemoval, Register, read

TABLES = {".csv": ",", ".tsv": "\t"}
"""Files from which single rows can be removed, and the separators of their cells."""

PARQUET, PACKED = ".parquet", ".gz"
GZIP_HEAD = 512
LONGEST_CELL = 2**31 - 1
MANIFEST = ".labcrane/labcrane_export.json"
"""File that labcrane writes next to an export: who is in it, and who was left out."""

STORE = ".labcrane-store"
"""Says in a store that it is one: without it the disk is not plugged in, only its folder there."""


@dataclass
class Reach:
    """The copies that an operation has changed, and those still unchanged.

    Attributes
    ----------
    changed, removed
        Files, for people.
    again
        Results computed from all participants' data that were removed: how to make them again.
    owed
        Copies that cannot be reached now: on a disk that is not plugged in, or an offline share.
    """

    changed: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    again: list[str] = field(default_factory=list)
    owed: list[OwedRemoval] = field(default_factory=list)


def kept_folder(places: Places, folder: Path) -> str:
    """Return a folder as the register keeps it: the data folder may move, with what is in it."""
    root = places.root.resolve()
    return folder.relative_to(root).as_posix() if folder.is_relative_to(root) else str(folder)


def enter(places: Places, register: Register, entry: Export) -> None:
    """Put an entry in the place of an earlier one; files of that one that are left are kept."""
    folder = places.root / entry.folder
    others: list[Export] = []
    for known in register.exports:
        if (known.folder, known.exporter) != (entry.folder, entry.exporter):
            others.append(known)
            continue
        left = {name: who for name, who in known.files.items() if os.path.lexists(folder / name)}
        entry.files = {**left, **entry.files}
        entry.people = sorted({*known.people, *entry.people} if left else entry.people)
    register.exports = [*others, entry]


def concerns(export: Export, participant: str) -> bool:
    """Say whether a participant's data are in an export."""
    return participant in export.people or any(participant in who for who in export.files.values())


def traces(export: Export | OwedRemoval) -> list[str]:
    """Return by what an export's folder is known to be the one it was written into."""
    return [*export.files, *([export.staging] if export.staging else [])]


def reachable(places: Places, folder: str, files: Iterable[str], reached: Sequence[str]) -> bool:
    """Say whether a folder is there, and is the one that was written into.

    Outside of the data folder one of the files must be there: of a disk that is not plugged in,
    the empty folder in which it will appear may be left.
    """
    if not Path(folder).is_absolute() or folder in reached:
        return True
    return any(os.path.lexists(Path(folder) / name) for name in files)


def store_reachable(store: str, study: str, files: Iterable[str], reached: Sequence[str]) -> bool:
    """Say the same of a store."""
    place = Path(store)
    if store in reached:
        return True
    return (place / STORE).is_file() or any(
        (place / (study or "study") / name).exists() for name in files
    )


def reached_now(places: Places, register: Register, participant: str) -> list[str]:
    """Return folders outside of the data folder with a participant's data that are there now."""
    exports = [
        export.folder
        for export in register.exports
        if concerns(export, participant)
        and Path(export.folder).is_absolute()
        and reachable(places, export.folder, traces(export), ())
    ]
    stores = [
        store
        for store, files in register.stores.items()
        if store_reachable(store, register.study, files, ())
    ]
    return [*exports, *stores]


def edit_exports(
    places: Places, register: Register, old: str, new: str | None, reach: Reach
) -> None:
    """Remove ``old`` from all that was written, or replace it by ``new``.

    Tables are edited row by row; files of the participant alone are removed, or renamed; what
    cannot be edited is removed, since it can be made again. May be repeated at any moment.
    """
    reached = register.work.reached if register.work else []
    mentions = Mentions({*register.names(), *(name for e in register.exports for name in e.people)})
    for export in register.exports:
        if not concerns(export, old):
            continue
        if not reachable(places, export.folder, traces(export), reached):
            owed = OwedRemoval(
                participant=old,
                to=new,
                folder=export.folder,
                files=export.files,
                whole=export.whole,
                staging=export.staging,
            )
            reach.owed.append(owed)
            continue
        if export.staging:
            shutil.rmtree(places.root / export.staging, ignore_errors=True)
        folder = places.root / export.folder
        edit_folder(folder, export.files, old, new, mentions, reach, whole=export.whole)
        if export.whole:
            reach.again.append(f"{export.exporter} in {places.root / export.folder}")


def edit_folder(
    folder: Path,
    files: Mapping[str, Sequence[str]],
    old: str,
    new: str | None,
    mentions: Mentions,
    reach: Reach,
    *,
    whole: bool,
) -> None:
    """Edit the files of one export; a whole one is removed, but for what all share."""
    for name, people in files.items():
        path = folder / name
        if path.is_symlink() or not path.parent.resolve().is_relative_to(folder.resolve()):
            if old in people:
                reach.owed.append(_owed_link(path, old, new))
        elif whole or _is_left_over(path, people, old, new, mentions):
            remove(path, reach)
        elif old in people or name == MANIFEST:
            edit_file(folder, name, people, old, new, mentions, reach)
    _drop_empty(folder, files)


def _drop_empty(folder: Path, files: Iterable[str]) -> None:
    """Remove the folders that held ``files`` and hold nothing now, but not ``folder`` itself."""
    above = {parent for name in files for parent in Path(name).parents if parent.name}
    for parent in sorted(above, key=lambda parent: len(parent.parts), reverse=True):
        place = folder / parent
        if place.is_dir() and not place.is_symlink() and not any(place.iterdir()):
            place.rmdir()


def _owed_link(path: Path, old: str, new: str | None) -> OwedRemoval:
    return OwedRemoval(participant=old, to=new, folder=str(path), link=True)


def _is_left_over(
    path: Path, people: Sequence[str], old: str, new: str | None, mentions: Mentions
) -> bool:
    """Return whether a file that is listed without participants mentions this one."""
    looked_at = old not in people and not path.as_posix().endswith(MANIFEST) and path.is_file()
    return looked_at and not people and old in mentioned(path, mentions)


def remove(path: Path, reach: Reach) -> None:
    """Remove a file, if it is there."""
    path.with_name(f".{path.name}{UNFINISHED}").unlink(missing_ok=True)
    if os.path.lexists(path):
        path.unlink()
        reach.removed.append(str(path))


def edit_file(
    folder: Path,
    name: str,
    people: Sequence[str],
    old: str,
    new: str | None,
    mentions: Mentions,
    reach: Reach,
) -> None:
    """Remove ``old`` from one file, or replace it by ``new``."""
    path = folder / name
    if not path.exists():
        path.with_name(f".{path.name}{UNFINISHED}").unlink(missing_ok=True)
        return
    if set(people) == {old} and new is None:
        remove(path, reach)
        return
    content = path.read_bytes()
    if new is None:
        edited = _without(name, content, old, mentions)
    else:
        edited = _renamed(name, content, old, new, mentions)
    if edited is None:
        remove(path, reach)
        return
    target = folder / (mentions.renamed(name, old, new) if new else name)
    if target == path and edited == content:
        return
    with replacing(target) as beside:
        beside.write_bytes(edited)
    if target != path:
        path.unlink()
    reach.changed.append(str(target))


def _without(name: str, content: bytes, old: str, mentions: Mentions) -> bytes | None:
    """Return a file of several people without one of them; None where that is impossible."""
    suffix = Path(name.removesuffix(PACKED)).suffix
    if name == MANIFEST:
        return _manifest_without(content, old)
    if suffix == PARQUET:
        return _parquet_without(content, old, mentions)
    if suffix not in TABLES:
        return None
    text = _text_of(name, content)
    rows = None if text is None else _rows_without(text, TABLES[suffix], old, mentions)
    return None if rows is None else _bytes_of(name, rows)


def _rows_without(text: str, separator: str, old: str, mentions: Mentions) -> str | None:
    """Return a table without the rows of ``old``; every other row stays unchanged, byte by byte.

    None where no row or header names a participant: its numbers may then be of all.
    """
    kept, named = [], False
    for number, (row, raw) in enumerate(_records(text, separator)):
        who = set().union(*(mentions.of(cell) for cell in row))
        if number == 0 and old in who:
            return None
        named = named or bool(who)
        if old not in who:
            kept.append(raw)
    return "".join(kept) if named else None


def _records(text: str, separator: str) -> Iterator[tuple[list[str], str]]:
    """Yield each record of a table with the text it was read from, however long its cells are."""
    lines = text.splitlines(keepends=True)
    usual = csv.field_size_limit(LONGEST_CELL)  # an event's data may be longer than csv allows
    try:
        reader = csv.reader(iter(lines), delimiter=separator)
        before = 0
        for row in reader:
            yield row, "".join(lines[before : reader.line_num])
            before = reader.line_num
    finally:
        csv.field_size_limit(usual)


def _manifest_without(content: bytes, old: str) -> bytes:
    noted: dict[str, Any] = json.loads(content)
    noted["participants"] = [
        row
        for row in noted["participants"]
        if old not in Mentions([old]).of(str(row["participant"]))
    ]
    return (json.dumps(noted, indent=2, ensure_ascii=False) + "\n").encode()


def _parquet_without(content: bytes, old: str, mentions: Mentions) -> bytes | None:
    import pyarrow as pa  # noqa: PLC0415 - loads for a second
    from pyarrow import parquet  # noqa: PLC0415

    table = parquet.read_table(io.BytesIO(content))
    keep, named = [True] * table.num_rows, False
    for column in table.columns:
        if not pa.types.is_string(column.type) and not pa.types.is_large_string(column.type):
            continue
        found = {value: mentions.of(value) for value in column.unique().to_pylist() if value}
        named = named or any(found.values())
        gone = {value for value, who in found.items() if old in who}
        if gone:
            keep = [
                kept and value not in gone
                for kept, value in zip(keep, column.to_pylist(), strict=True)
            ]
    if not named or any(old in mentions.of(column) for column in table.column_names):
        return None
    return _parquet_bytes(table.filter(pa.array(keep)))


def _parquet_bytes(table: Any) -> bytes:
    from pyarrow import parquet  # noqa: PLC0415

    out = io.BytesIO()
    parquet.write_table(table, out)
    return out.getvalue()


def _renamed(name: str, content: bytes, old: str, new: str, mentions: Mentions) -> bytes | None:
    """Return a file with another pseudonym; None where it is packed in a way that cannot be."""
    if name.endswith(PARQUET):
        return _parquet_renamed(content, old, new, mentions)
    text = _text_of(name, content)
    if text is None:
        return None
    renamed = mentions.renamed(text, old, new)
    # A packed file says in its head what it was called when it was packed.
    named = name.endswith(PACKED) and old in mentions.of(content[:GZIP_HEAD].decode("latin-1"))
    return content if renamed == text and not named else _bytes_of(name, renamed)


def _parquet_renamed(content: bytes, old: str, new: str, mentions: Mentions) -> bytes:
    import pyarrow as pa  # noqa: PLC0415
    from pyarrow import parquet  # noqa: PLC0415

    table = parquet.read_table(io.BytesIO(content))
    edited = False
    for number, column in enumerate(table.columns):
        if not pa.types.is_string(column.type) and not pa.types.is_large_string(column.type):
            continue
        values = column.to_pylist()
        renamed = [value and mentions.renamed(value, old, new) for value in values]
        if renamed != values:
            edited = True
            table = table.set_column(number, table.field(number), pa.array(renamed, column.type))
    return _parquet_bytes(table) if edited else content


def _text_of(name: str, content: bytes) -> str | None:
    """Return a file's text, unpacked; None if it is not a text."""
    try:
        text = (gzip.decompress(content) if name.endswith(PACKED) else content).decode("utf-8")
    except (UnicodeDecodeError, OSError, EOFError):
        return None
    return None if "\x00" in text else text


def _bytes_of(name: str, text: str) -> bytes:
    content = text.encode("utf-8")
    # Without a time in its head, the same data are the same file.
    return gzip.compress(content, mtime=0) if name.endswith(PACKED) else content


def forget_export(places: Places, register: Register, old: str, new: str | None) -> None:
    """Bring the list of what was written up to what :func:`edit_exports` has done."""
    mentions = Mentions({*register.names(), *(name for e in register.exports for name in e.people)})
    for export in register.exports:
        if not concerns(export, old):
            continue
        folder = places.root / export.folder
        files: dict[str, list[str]] = {}
        for name, people in export.files.items():
            now = mentions.renamed(name, old, new) if new and old in people else name
            rest = {person for person in people if person != old}
            if new and old in people:
                rest.add(new)
            if os.path.lexists(folder / now) and (rest or not people):
                files[now] = sorted(rest)
        kept = {person for person in export.people if person != old}
        if new and not export.whole and old in export.people:
            kept.add(new)
        export.files, export.people, export.staging = files, sorted(kept), ""
    register.exports = [export for export in register.exports if export.files or export.staging]


def in_store(store: Path, study: str, participant: str) -> Path:
    """Return where a store keeps a participant's recordings."""
    return store / (study or "study") / participant


def remove_from_stores(register: Register, participant: str, reach: Reach) -> None:
    """Remove a participant from every store that is there."""
    reached = register.work.reached if register.work else []
    for name, files in register.stores.items():
        if not any(file.split("/")[0] == participant for file in files):
            continue
        if not store_reachable(name, register.study, files, reached):
            reach.owed.append(OwedRemoval(participant=participant, folder=name))
            continue
        folder = in_store(Path(name), register.study, participant)
        if folder.is_symlink():
            reach.owed.append(_owed_link(folder, participant, None))
        elif folder.is_dir():
            shutil.rmtree(folder)
            reach.removed.append(str(folder))


def write_manifest(folder: Path, content: Mapping[str, Any]) -> None:
    """Describe an export in a file next to it; BIDS and Psych-DS ignore hidden folders."""
    text = json.dumps(content, indent=2, ensure_ascii=False) + "\n"
    write_text(folder / MANIFEST, text)


HERE, AWAY, DUE = "there", "cannot be reached now", "due: to be erased or relabelled"


@dataclass(frozen=True, slots=True)
class InventoryEntry:
    """One place.

    Attributes
    ----------
    what
        ``recordings``, ``register``, ``store``, or what wrote it: an exporter, a command.
    where
        Folder or file.
    state
        Whether it can be reached, or is still to be erased.
    """

    what: str
    where: str
    state: str


def inventory(places: Places, participant: str) -> list[InventoryEntry]:
    """Return every place with data of a participant, by exact name."""
    register = read(places)
    found = [
        InventoryEntry("recordings", str(folder), HERE) for folder in places.all_raw(participant)
    ]
    found += [
        InventoryEntry("recordings", str(link), "a link, which is never followed")
        for link in places.links(participant)
    ]
    if participant in register.participants:
        found.append(InventoryEntry("register", str(places.register), HERE))
    if any(stone.participant == participant for stone in register.tombstones):
        found.append(InventoryEntry("register", str(places.register), "erasure record: was erased"))
    for export in register.exports:
        if not concerns(export, participant):
            continue
        folder = places.root / export.folder
        there = reachable(places, export.folder, traces(export), ())
        state = HERE if there else AWAY
        if export.staging:
            found.append(
                InventoryEntry(export.exporter, str(places.root / export.staging), "not finished")
            )
        found += [
            InventoryEntry(export.exporter, str(folder / name), state)
            for name, people in sorted(export.files.items())
            if participant in people
        ]
    found += [
        InventoryEntry("merged from", each.folder, "not reached from here: erase or relabel there")
        for each in register.merges
        if participant in each.participants
    ]
    for store, files in register.stores.items():
        if any(name.split("/")[0] == participant for name in files):
            state = HERE if store_reachable(store, register.study, files, ()) else AWAY
            place = in_store(Path(store), register.study, participant)
            found.append(InventoryEntry("store", str(place), state))
    found += [
        InventoryEntry("owed", owed.folder, DUE)
        for owed in register.owed
        if owed.participant == participant
    ]
    return found
