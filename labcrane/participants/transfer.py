"""Copy finished sessions to the lab's store, and prove that both sides are equal."""

import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.files.atomic import copy, sha256, write_text
from labcrane.participants.copies import (
    STORE,
    Reach,
    edit_folder,
    in_store,
    store_reachable,
    traces,
)
from labcrane.participants.folders import Places
from labcrane.participants.mentions import Mentions
from labcrane.participants.register import OwedRemoval, Register, changed, read
from labcrane.recording.participant_file.recover import is_recovered


@dataclass
class Transferred:
    """Present content of the store.

    Attributes
    ----------
    copied
        Files that were copied, and read again: equal on both sides.
    equal
        How many files are in the store, these included.
    only_here
        Missing files, and why.
    """

    copied: list[str] = field(default_factory=list)
    equal: int = 0
    only_here: list[str] = field(default_factory=list)


def transfer(places: Places, store: Path) -> Transferred:
    """Copy every finished session to ``store``; may be killed and repeated at any moment.

    Raises
    ------
    RecordingError
        The store is not there.
    """
    if not store.is_dir():
        raise RecordingError(f"there is no folder {store}; plug the store in, or make the folder")
    store = store.resolve()
    if not (store / STORE).exists():
        write_text(store / STORE, "labcrane transfer copies recordings here; leave this file\n")
    with changed(places) as register:
        register.stores.setdefault(str(store), {})
    settle_owed(places)
    register, done = read(places), Transferred()
    for participant in sorted(register.participants):
        folder = places.raw(participant)
        if folder.is_symlink():
            done.only_here.append(f"{participant}: {folder} is a link, which is not followed")
            continue
        unfinished = _unfinished(folder)
        for path in sorted(path for path in folder.glob("*") if path.is_file()):
            name = f"{participant}/{path.name}"
            if path.is_symlink():
                done.only_here.append(f"{name}: a link, which is not followed")
                continue
            if path.name.startswith(".") or path.name.startswith(tuple(unfinished)):
                continue
            _one(places, store, register, name, path, done)
        done.only_here += [f"{participant}/{ses}: not finished" for ses in sorted(unfinished)]
    done.only_here += [
        f"{folder.name}: not of a participant in the register; pilots and simulations stay here"
        for folder in sorted(places.root.iterdir())
        if folder.is_dir() and folder.name not in register.participants
        and not folder.name.startswith(".")
        and folder not in {places.register.parent, places.exports}
    ]  # fmt: skip
    return done


def _one(
    places: Places, store: Path, register: Register, name: str, path: Path, done: Transferred
) -> None:
    target = in_store(store, register.study, path.parent.name) / path.name
    ours, put = sha256(path), register.stores[str(store)].get(name)
    theirs = sha256(target) if target.exists() else None
    if theirs not in {None, ours, put}:
        done.only_here.append(f"{name}: the store has another file {target}, not from labcrane")
        return
    if theirs != ours:
        # Entered first: a copy that a kill leaves behind is known to the register.
        with changed(places) as now:
            now.stores[str(store)][name] = ours
        copy(path, target)
        if sha256(target) != ours:
            raise RecordingError(f"{target} differs from {path} after copying; check the store")
        done.copied.append(name)
    elif put != ours:
        with changed(places) as now:
            now.stores[str(store)][name] = ours
    done.equal += 1


def settle_owed(places: Places) -> None:
    """Erase and relabel in folders that could not be reached then, and can be now."""
    register = read(places)
    there = [_is_there(owed, register) for owed in register.owed]
    if not any(there):
        return
    with changed(places) as register:
        # Noted first: what a kill leaves may not look like that folder any more.
        for owed, now in zip(register.owed, there, strict=True):
            owed.reached = owed.reached or now
    with changed(places) as register:
        for owed in register.owed:
            if owed.reached:
                _settle(owed, register)
        register.owed = [owed for owed in register.owed if not owed.reached]


def _is_there(owed: OwedRemoval, register: Register) -> bool:
    if owed.reached:
        return True
    if owed.link:
        return Path(owed.folder).parent.is_dir() and not os.path.lexists(owed.folder)
    if named := traces(owed):
        return any(os.path.lexists(Path(owed.folder) / name) for name in named)
    return store_reachable(owed.folder, register.study, register.stores.get(owed.folder, ()), ())


def _settle(owed: OwedRemoval, register: Register) -> None:
    if owed.link:
        return
    folder = Path(owed.folder)
    if owed.staging:
        shutil.rmtree(folder / owed.staging, ignore_errors=True)
    if owed.files:
        people = [name for who in owed.files.values() for name in who]
        mentions = Mentions({*register.names(), *people, owed.participant})
        old, new = owed.participant, owed.to
        edit_folder(folder, owed.files, old, new, mentions, Reach(), whole=owed.whole)
    elif not owed.staging:
        copies = in_store(folder, register.study, owed.participant)
        if copies.is_dir() and not copies.is_symlink():
            shutil.rmtree(copies)


def _unfinished(folder: Path) -> set[str]:
    """Return the prefixes of sessions whose journals are not, or not wholly, in the file."""
    found = {path.name.split("_")[0] for path in folder.glob("ses-*_*.xdf")}
    return {ses for ses in found if not is_recovered(folder, int(ses.removeprefix("ses-")))}
