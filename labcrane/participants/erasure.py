"""Erase a participant."""

import re
import shutil
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from labcrane.files.names import OURS, check_name
from labcrane.participants.copies import (
    Reach,
    edit_exports,
    forget_export,
    reached_now,
    remove_from_stores,
)
from labcrane.participants.enrolment import check_words
from labcrane.participants.folders import Places
from labcrane.participants.mentions import Mentions
from labcrane.participants.proof import searched
from labcrane.participants.register import (
    OwedRemoval,
    Register,
    Tombstone,
    Work,
    begun,
    changed,
    read,
)


@dataclass(frozen=True, slots=True)
class Erased:
    """Outcome of erasing a participant's data.

    Attributes
    ----------
    reach
        Files that were removed or changed, and folders that could not be reached.
    mentions
        Files that still hold the pseudonym: written by people, not by labcrane.
    unsearched
        Files that could not be searched for it, and why: they may still contain it.
    """

    reach: Reach
    mentions: list[str]
    unsearched: list[str]


FILM = re.compile(r"ses-[0-9]+_.+\.mkv")
"""Names of the files of cameras, microphones and screens."""

BEYOND = (
    "labcrane cannot reach backups, snapshots, copies made by hand and remains of deleted files on "
    "a disk; ask their administrators to erase them"
)


def begin(places: Places, participant: str, reason: str, today: date) -> None:
    """Write down that a participant is to be erased: from here on it will be done.

    Raises
    ------
    ProtocolError
        Nothing is known of the participant.
    """
    check_words(reason, "reason")

    def check(register: Register) -> None:
        if participant in register.participants:
            # A name that could not be given today, but was: it is one folder's all the same.
            if Path(participant).name != participant or participant.lower() in OURS:
                check_name(participant, "participant")
            return
        check_name(participant, "participant")
        if not (places.all_raw(participant) or places.links(participant)):
            register.entry(participant)  # says who there is

    work = Work(kind="erase", participant=participant, reason=reason, date=today.isoformat())
    begun(places, work, check)


def carry_out(places: Places, work: Work) -> Erased:
    """Erase; may be killed and repeated at any moment."""
    participant, reach = work.participant, Reach()
    register = reaching(places, participant)
    reach.owed += [
        OwedRemoval(participant=participant, folder=str(link), link=True)
        for link in places.links(participant)
    ]
    for folder in places.all_raw(participant):
        shutil.rmtree(folder)
        reach.removed.append(str(folder))
    edit_exports(places, register, participant, None, reach)
    remove_from_stores(register, participant, reach)
    with changed(places) as now:
        now.participants.pop(participant, None)
        forget_export(places, now, participant, None)
        forget_store(now, participant)
        now.owed += reach.owed
        now.tombstones.append(
            Tombstone(participant=participant, date=work.date, reason=work.reason)
        )
        now.work = None
    return Erased(reach, *mentions(places, participant))


def reaching(places: Places, participant: str) -> Register:
    """Return the register, after noting in it which folders elsewhere are there.

    Noted first: of a folder that a kill leaves empty of the participant's files, the next call
    must know that it was there.
    """
    with changed(places) as register:
        assert register.work is not None  # noqa: S101 - begun before
        there = reached_now(places, register, participant)
        register.work.reached = sorted({*register.work.reached, *there})
    return read(places)


def forget_store(register: Register, participant: str) -> None:
    """Take a participant's files off the lists of what the stores hold."""
    register.stores = {
        store: {name: sha for name, sha in files.items() if name.split("/")[0] != participant}
        for store, files in register.stores.items()
    }


def mentions(places: Places, participant: str) -> tuple[list[str], list[str]]:
    """Return files with the pseudonym in name or content, and files that could not be searched.

    Of the data folder, and of all exports. What is packed is opened. The register is left out: it
    keeps the erasure record. So are films: no name is written into them, and among their bytes any
    pseudonym comes up by chance.
    """
    register = read(places)
    names = Mentions({*register.names(), participant})
    written = [
        places.root / export.folder / name for export in register.exports for name in export.files
    ]
    found, unsearched = [], []
    for path in dict.fromkeys([*places.files(), *written]):
        if path == places.register or path.is_symlink() or not path.is_file():
            continue
        if FILM.fullmatch(path.name):
            continue
        under = path.relative_to(places.root) if path.is_relative_to(places.root) else path.name
        done = searched(path, names)
        if participant in names.of(str(under)) | done.found:
            found.append(str(path))
        else:
            unsearched += [f"{path.parent / line}" for line in done.closed]
    return found, unsearched
