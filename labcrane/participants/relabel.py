"""Repair a wrong participant number."""

import os
import re
import shutil
from datetime import date
from pathlib import Path

from labcrane.errors import ProtocolError
from labcrane.files.atomic import copy, give_name, make_folder, replacing, sync_folder, write_text
from labcrane.files.names import check_name
from labcrane.participants.copies import (
    Reach,
    edit_exports,
    forget_export,
    remove_from_stores,
    store_reachable,
)
from labcrane.participants.enrolment import check_apart, check_words
from labcrane.participants.erasure import forget_store, reaching
from labcrane.participants.folders import Places
from labcrane.participants.register import (
    Deviation,
    Entry,
    Register,
    Work,
    begun,
    changed,
    read,
)
from labcrane.participants.transfer import transfer
from labcrane.recording.annotations import is_annotations
from labcrane.recording.participant_file.relabel import (
    relabel_journal,
    relabel_participant_file,
    renaming,
)


def begin(places: Places, old: str, new: str, reason: str, today: date) -> None:
    """Write down that ``old`` was really ``new``: from here on it will be repaired.

    Raises
    ------
    ProtocolError
        ``old`` has no data, or ``new`` is not possible or has data of its own.
    """
    check_words(reason, "reason")

    def check(register: Register) -> None:
        register.entry(old)
        check_name(new, "participant")
        if old == new or not re.fullmatch(register.pattern, new):
            raise ProtocolError(
                f"{old} cannot become {new!r}: give another pseudonym that matches "
                f"{register.pattern!r}"
            )
        if any(stone.participant == new for stone in register.tombstones):
            raise ProtocolError(f"{new} was erased; give a pseudonym that was never used")
        known = register.participants.get(new)
        if known is None:
            check_apart(register, new, instead_of=old)
        if links := places.links(old):
            raise ProtocolError(
                f"{links[0]} is a link, and links are never followed; put the folder itself there, "
                f"then relabel {old}"
            )
        if _is_taken(places, old, new) or (known and known.sessions):
            raise ProtocolError(
                f"{new} has recordings of its own; relabel {new} first, to where they belong"
            )

    work = Work(kind="relabel", participant=old, to=new, reason=reason, date=today.isoformat())
    begun(places, work, check)


def _is_taken(places: Places, old: str, new: str) -> bool:
    """Say whether a folder that the recordings of ``old`` are to have is there already."""
    return any(
        os.path.lexists(_renamed(folder, old, new))
        for folder in {places.raw(old), *places.all_raw(old)}
    )


def _renamed(folder: Path, old: str, new: str) -> Path:
    """Return what a participant's folder will be called; its stamps stay."""
    return folder.with_name(new + folder.name.removeprefix(old))


def carry_out(places: Places, work: Work) -> Reach:
    """Relabel; may be killed and repeated at any moment."""
    old, new, reach = work.participant, work.to, Reach()
    register = reaching(places, old)
    for folder in places.all_raw(old):
        _relabel_folder(folder, _renamed(folder, old, new), old, new)
    reach.changed += [
        str(path) for folder in places.all_raw(new) for path in sorted(folder.glob("*"))
    ]
    edit_exports(places, register, old, new, reach)
    remove_from_stores(register, old, reach)
    with changed(places) as now:
        if old in now.participants:
            now.participants[new] = _merged(now, work)
            del now.participants[old]
        forget_export(places, now, old, new)
        forget_store(now, old)
        now.owed += reach.owed
    now = read(places)
    for name, files in now.stores.items():
        if store_reachable(name, now.study, files, work.reached) and Path(name).is_dir():
            transfer(places, Path(name))
    with changed(places) as now:
        now.work = None
    return reach


def _relabel_folder(source: Path, target: Path, old: str, new: str) -> None:
    """Make the new folder next to the old one, then rename it, then remove the old one."""
    beside = target.with_name(f".{target.name}.relabelled")
    if not target.exists():
        make_folder(beside)
        _relabel_files(source, beside, old, new)
        sync_folder(beside)
        give_name(beside, target)
        sync_folder(target.parent)
    shutil.rmtree(source)


def _relabel_files(source: Path, target: Path, old: str, new: str) -> None:
    rename = renaming(old, new)
    sizes: dict[str, int] = {}
    for path in sorted(path for path in source.glob("*.xdf") if not path.is_symlink()):
        journal = target / rename(path.name)
        relabel_journal(path, journal, old, new)
        sizes[journal.name] = journal.stat().st_size
    for path in sorted(source.rglob("*")):
        place = target / rename(path.relative_to(source).as_posix())
        if not path.is_file() or path.is_symlink() or path.suffix == ".xdf":
            continue
        if path.suffix == ".h5":
            with replacing(place) as beside:
                relabel_participant_file(path, beside, old, new, sizes)
        elif is_annotations(path):
            write_text(place, rename(path.read_text(encoding="utf-8")))
        else:
            copy(path, place)


def _merged(register: Register, work: Work) -> Entry:
    """Return the entry of the correct pseudonym: the sessions run, and the plan they followed."""
    wrong = register.participants[work.participant]
    meant = register.participants.get(work.to)
    detail = (
        f"run as {work.participant}, with slot {wrong.slot}{_group(wrong)} and seed {wrong.seed}"
    )
    if meant is not None:
        detail += f", instead of slot {meant.slot}{_group(meant)} and seed {meant.seed}"
    deviation = Deviation(
        what="wrong participant number",
        detail=f"{detail}: {work.reason}",
        date=work.date,
    )
    entry = wrong.model_copy(deep=True)
    entry.formerly.append(work.participant)
    entry.deviations.append(deviation)
    if meant is not None:
        known = {consent.version for consent in meant.consent}
        entry.consent = [*meant.consent, *(c for c in entry.consent if c.version not in known)]
        entry.notes = [*meant.notes, *entry.notes]
        entry.deviations = [*meant.deviations, *entry.deviations]
        entry.formerly = [*meant.formerly, *entry.formerly]
        entry.exclusion = meant.exclusion or entry.exclusion
    return entry


def _group(entry: Entry) -> str:
    return f" (group {entry.group})" if entry.group else ""
