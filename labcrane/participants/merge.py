"""Merge another data folder of the same study into this one: one study, several laboratories."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.atomic import copy, give_name, sha256, sync_folder
from labcrane.participants.deviations import sessions_of
from labcrane.participants.enrolment import check_apart
from labcrane.participants.folders import Places, entries
from labcrane.participants.register import (
    Entry,
    Export,
    Merge,
    Register,
    changed,
    read,
    unregistered,
)
from labcrane.recording.data_folder import DataFolder, recorded
from labcrane.recording.participant_file.recover import is_recovered

STAGING = ".merging"
"""Folder in the data folder in which recordings are copied; they are not yet the study's."""


@dataclass(frozen=True, slots=True)
class Merged:
    """What was taken from the other data folder.

    Attributes
    ----------
    taken
        Participants who are new in the register.
    equal
        Participants who were in it already, with equal content. Both are empty where the other
        register was merged before as it is: what was changed here since is not looked at.
    shared
        Who holds each slot that several participants hold.
    only_there
        Recordings of pilots and simulations, which are not taken.
    """

    taken: list[str]
    equal: list[str]
    shared: dict[int, list[str]]
    only_there: list[str]


def merge(
    places: Places, other: Places, today: date, known: frozenset[str] | None, study: str = ""
) -> Merged:
    """Take recordings and register of ``other``; may be killed and repeated at any moment.

    The recordings are copied byte by byte beside those of the study. They get their places while
    the register is held, which is written at the end, at once. What was killed in between is
    completed by the next call.

    Parameters
    ----------
    known
        Seals of the study's present lock and of those that it has replaced; None without a lock.
    study
        What the study's protocol calls it; needed only while the register here is empty.

    Raises
    ------
    RecordingError
        The other folder has no register, or it was changed meanwhile.
    ProtocolError
        The two contradict each other; every contradiction is listed, and nothing was changed.
    """
    if not other.register.is_file():
        raise RecordingError(
            f"{other.root} has no register; give the data folder in which these people took part, "
            "with its folder register"
        )
    if places.root.exists() and places.root.samefile(other.root):
        raise ProtocolError(f"{other.root} is the study's own data folder; give the other one")
    state = sha256(other.register)
    ours, theirs = read(places), read(other)
    ours.study = ours.study or study
    theirs.check_finished()
    taken = [name for name in theirs.participants if name not in ours.participants]
    done = any(each.register_sha256 == state for each in ours.merges)
    if not done:
        found = [
            *_contradictions(places, ours, theirs, known),
            *_in_recordings(places, ours, other, theirs),
        ]
        if found:
            raise ProtocolError(_refusal(places, other, found))
        with _staged(places, other, sorted(theirs.participants)) as copies, changed(places) as now:
            if sha256(other.register) != state:
                raise RecordingError(f"{other.register} was changed meanwhile; merge again")
            now.check_finished()
            if found := _contradictions(
                places, now, theirs, known
            ):  # someone was enrolled meanwhile
                raise ProtocolError(_refusal(places, other, found))
            for copied in copies:
                _give_place(copied, places.raw(copied.name))
            _join(now, theirs, other)
            now.merges.append(
                Merge(
                    date=today.isoformat(),
                    folder=str(other.root.resolve()),
                    register_sha256=state,
                    participants=sorted(theirs.participants),
                )
            )
    return Merged(
        [] if done else sorted(taken),
        [] if done else sorted(set(theirs.participants) - set(taken)),
        {slot: names for slot, names in read(places).holders().items() if len(names) > 1},
        [each.name for each in recorded(other.root) if each.name not in theirs.participants],
    )


def _refusal(places: Places, other: Places, found: list[str]) -> str:
    listed = "\n".join(f"  {line}" for line in found)
    return (
        f"{other.root} contradicts {places.root}; nothing of it was taken:\n{listed}\n"
        "correct this where it is wrong, then merge again"
    )


def _contradictions(
    places: Places, ours: Register, theirs: Register, known: frozenset[str] | None
) -> list[str]:
    """Return what cannot be true in both registers."""
    if ours.study and ours.study != theirs.study:
        return [f"it is of study {theirs.study!r}, this one of {ours.study!r}"]
    found = [
        f"{who} was run under lock {seal[:12]}, which is not the study's lock here or one that it "
        "has replaced; put the newest lock of the study beside its protocol"
        for seal, who in theirs.locks.items()
        if seal not in _accepted(ours, theirs, known)
    ]
    erased = {stone.participant for stone in ours.tombstones}
    erased_there = {stone.participant for stone in theirs.tombstones}
    here = {*ours.participants, *(each.name for each in recorded(places.root))}
    before = {name for each in ours.merges for name in each.participants}
    found += [
        f"{name} was erased there and not here; erase {name} here first"
        for name in sorted(erased_there & here)
    ]
    for name, entry in sorted(theirs.participants.items()):
        found += [
            f"{former} was relabelled {name} there and not here; relabel it here first"
            for former in entry.formerly
            if former in here and former not in theirs.participants
        ]
        if name in erased:
            found.append(f"{name} was erased here and not there; erase {name} there, too")
        elif (own := ours.participants.get(name)) is not None:
            if differs := [
                key for key in Entry.model_fields if getattr(own, key) != getattr(entry, key)
            ]:
                found.append(
                    f"{name} is in both registers with different content: {', '.join(differs)}; "
                    "if these are two people, relabel one of them; if it is one, merge both "
                    "laboratories into a new copy of the study without data"
                )
        elif name in before:
            found.append(f"{name} was merged before and relabelled here; relabel there, too")
        else:
            try:
                check_apart(ours, name)
            except ProtocolError as error:
                found.append(str(error))
    return found


def _accepted(ours: Register, theirs: Register, known: frozenset[str] | None) -> frozenset[str]:
    """Return the seals under which people may have been run; without a lock, those used here."""
    if known is not None:
        return known
    return frozenset(ours.locks or theirs.locks)


def _in_recordings(
    places: Places, ours: Register, other: Places, theirs: Register
) -> Iterator[str]:
    """Yield why recordings cannot be taken."""
    for name in unregistered(other):
        yield f"{name} has recordings there, but is not in the register there"
    merged = {name for each in (*ours.merges, *theirs.merges) for name in each.participants}
    for name, entry in sorted(theirs.participants.items()):
        own, folder = places.raw(name), other.raw(name)
        if links := [each for each in (own, folder, *folder.rglob("*")) if each.is_symlink()]:
            yield f"{links[0]} is a link, and links are never followed; put the file itself there"
            continue
        sessions = sessions_of(other, name)
        yield from (
            f"{name}, session {sat.session} is in the register there and not recorded there; put "
            "its recordings back"
            for sat in entry.sessions
            if sat.deviations is not None and sat.session not in sessions
        )
        for session in DataFolder(other.root, name, pilot=False, simulated=False).sessions():
            try:
                whole = is_recovered(folder, session)
            except RecordingError as error:
                yield f"{name}, session {session}: {error}"
                continue
            if not whole:
                yield (
                    f"{name}, session {session} is running there, or was stopped: labcrane resume "
                    f"continues it, and labcrane recover {folder} builds the participant file"
                )
        here, there = _files(own), _files(folder)
        if name in ours.participants and name not in merged and not (here and here == there):
            yield (
                f"{name} is in both registers, and no recording shows that it is one person; "
                "relabel one of them"
            )
        elif here and (there or name not in ours.participants) and here != there:
            differs = sorted(file for file, _ in set(here.items()) ^ set(there.items()))
            yield f"{name} has other recordings here: {', '.join(dict.fromkeys(differs))}"


def _paths(folder: Path) -> list[Path]:
    """Return every file of a participant but the hidden ones, which are only kept for speed."""
    return [
        each
        for each in entries(folder)
        if each.is_file()
        and not any(part.startswith(".") for part in each.relative_to(folder).parts)
    ]


def _files(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file of a participant."""
    return {path.relative_to(folder).as_posix(): sha256(path) for path in _paths(folder)}


@contextmanager
def _staged(places: Places, other: Places, names: list[str]) -> Iterator[list[Path]]:
    """Copy the recordings that are not here; give their folders, all of them on the disk."""
    staging = places.root / STAGING
    missing = [name for name in names if _paths(other.raw(name)) and not _paths(places.raw(name))]
    try:
        shutil.rmtree(staging, ignore_errors=True)  # left by a process that was killed
        for name in missing:
            for file, sha in _files(other.raw(name)).items():
                copy(other.raw(name) / file, staging / name / file)
                if sha256(staging / name / file) != sha:
                    raise RecordingError(
                        f"{other.raw(name) / file} differs after copying; check both disks, and "
                        "that no session is running there"
                    )
        yield [staging / name for name in missing]
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _give_place(copied: Path, place: Path) -> None:
    if place.is_dir():  # without a file, as was seen
        shutil.rmtree(place)
    give_name(copied, place)
    sync_folder(place.parent)


def _join(register: Register, theirs: Register, other: Places) -> None:
    """Enter what the other register knows; the order of several merges makes no difference."""
    register.study = register.study or theirs.study
    register.pattern = register.pattern or theirs.pattern
    both = {**theirs.participants, **register.participants}
    register.participants = dict(sorted(both.items()))
    register.shared_slots = sorted(
        slot for slot, names in register.holders().items() if len(names) > 1
    )
    for store, files in theirs.stores.items():
        register.stores[store] = {**files, **register.stores.get(store, {})}
    known = {(each.exporter, each.date, each.folder) for each in register.exports}
    exports = [_elsewhere(each, other) for each in theirs.exports]
    register.exports += [
        each for each in exports if (each.exporter, each.date, each.folder) not in known
    ]
    register.owed += [each for each in theirs.owed if each not in register.owed]
    register.merges += [each for each in theirs.merges if each not in register.merges]
    stones = [*register.tombstones, *theirs.tombstones]
    register.tombstones = sorted(
        (each for at, each in enumerate(stones) if each not in stones[:at]),
        key=lambda each: (each.participant, each.date, each.reason),
    )


def _elsewhere(export: Export, other: Places) -> Export:
    """Return an export with its folders as they are found from here."""
    root = other.root.resolve()
    staging = str(root / export.staging) if export.staging else ""
    return export.model_copy(update={"folder": str(root / export.folder), "staging": staging})
