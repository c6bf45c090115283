"""Erase, relabel and transfer: what a kill interrupted is finished by the next call of any."""

from datetime import date
from pathlib import Path

from labcrane.files.lock import exclusive
from labcrane.participants import erasure, merge, relabel, transfer
from labcrane.participants.copies import Reach
from labcrane.participants.erasure import Erased
from labcrane.participants.folders import Places
from labcrane.participants.merge import Merged
from labcrane.participants.register import Work, read
from labcrane.participants.transfer import Transferred


def erase(places: Places, participant: str, reason: str, today: date) -> Erased:
    """Erase a participant from everything that labcrane has written.

    Calling it again for a participant who was being erased finishes that.
    """
    with exclusive(places.work_lock):
        pending, done = _finish(places)
        if isinstance(done, Erased) and pending and pending.participant == participant:
            return done
        erasure.begin(places, participant, reason, today)
        _, done = _finish(places)
        assert isinstance(done, Erased)  # noqa: S101 - that is what was begun
        return done


def correct(places: Places, old: str, new: str, reason: str, today: date) -> Reach:
    """Give the recordings of ``old`` the participant number ``new``."""
    with exclusive(places.work_lock):
        pending, done = _finish(places)
        if isinstance(done, Reach) and pending and (pending.participant, pending.to) == (old, new):
            return done
        relabel.begin(places, old, new, reason, today)
        _, done = _finish(places)
        assert isinstance(done, Reach)  # noqa: S101 - that is what was begun
        return done


def move(places: Places, store: Path) -> Transferred:
    """Copy finished sessions to the lab's store."""
    with exclusive(places.work_lock):
        _finish(places)
        return transfer.transfer(places, store)


def join(
    places: Places, other: Places, today: date, known: frozenset[str] | None, study: str = ""
) -> Merged:
    """Take recordings and register of another data folder of the study."""
    with exclusive(places.work_lock):
        _finish(places)
        return merge.merge(places, other, today, known, study)


def _finish(places: Places) -> tuple[Work | None, Erased | Reach | None]:
    """Finish an interrupted operation; return it with its result."""
    work = read(places).work
    done: Erased | Reach | None = None
    if work is not None:
        begun = erasure if work.kind == "erase" else relabel
        done = begun.carry_out(places, work)
    transfer.settle_owed(places)
    return work, done
