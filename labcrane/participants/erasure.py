"""Erase a participant."""

import re
import shutil
from dataclasses import dataclass
from datetime import date

from labcrane.errors import ProtocolError
from labcrane.participants.copies import Reach, edit_exports, forget_export, remove_from_stores
from labcrane.participants.enrolment import check_words
from labcrane.participants.folders import Places
from labcrane.participants.register import Register, Tombstone, Work, begun, changed, read


@dataclass(frozen=True, slots=True)
class Erased:
    """What became of a participant's data.

    Attributes
    ----------
    reach
        Files that were removed or changed, and folders that could not be reached.
    mentions
        Files of the data folder that still hold the pseudonym: written by people, not by labcrane.
    """

    reach: Reach
    mentions: list[str]


BEYOND = (
    "labcrane cannot reach backups, snapshots and copies made by hand, nor what a disk keeps of "
    "deleted files: have them erased by whoever looks after them"
)


def begin(places: Places, participant: str, reason: str, today: date) -> None:
    """Write down that a participant is to be erased: from here on it will be done.

    Raises
    ------
    ProtocolError
        Nothing is known of the participant.
    """
    check_words(reason, "reason")
    if not re.fullmatch(r"[A-Za-z0-9_]+", participant):
        raise ProtocolError(
            f"{participant!r} is no pseudonym; give it without stamps: P007, not P007-PILOT"
        )

    def check(register: Register) -> None:
        if participant not in register.participants and not places.all_raw(participant):
            register.entry(participant)  # says who there is

    work = Work(kind="erase", participant=participant, reason=reason, date=today.isoformat())
    begun(places, work, check)


def carry_out(places: Places, work: Work) -> Erased:
    """Erase; may be killed and repeated at any moment."""
    participant, register, reach = work.participant, read(places), Reach()
    for folder in places.all_raw(participant):
        shutil.rmtree(folder)
        reach.removed.append(str(folder))
    edit_exports(places, register, participant, None, reach)
    remove_from_stores(register, participant, reach)
    with changed(places) as now:
        now.participants.pop(participant, None)
        forget_export(now, participant, None)
        forget_store(now, participant)
        now.owed += reach.owed
        now.tombstones.append(
            Tombstone(participant=participant, date=work.date, reason=work.reason)
        )
        now.work = None
    return Erased(reach, mentions(places, participant))


def forget_store(register: Register, participant: str) -> None:
    """Take a participant's files off the lists of what the stores hold."""
    register.stores = {
        store: {name: sha for name, sha in files.items() if name.split("/")[0] != participant}
        for store, files in register.stores.items()
    }


def mentions(places: Places, participant: str) -> list[str]:
    """Return the files of the data folder, but the register, with the pseudonym in them."""
    word = participant.encode()
    return [
        str(path)
        for path in places.files()
        if path != places.register and (word in path.name.encode() or word in path.read_bytes())
    ]
