"""Copy finished sessions to the lab's store, and prove that both sides are equal."""

import shutil
from dataclasses import dataclass, field
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.files.atomic import copy, sha256
from labcrane.participants.copies import Reach, edit_file, in_store
from labcrane.participants.folders import Places
from labcrane.participants.register import Register, changed, read
from labcrane.recording.participant_file.recover import is_recovered


@dataclass
class Transferred:
    """What is in the store now.

    Attributes
    ----------
    copied
        Files that were copied, and read again: equal on both sides.
    equal
        How many files are in the store, these included.
    only_here
        What is not there, and why.
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
    with changed(places) as register:
        register.stores.setdefault(str(store), {})
    settle_owed(places)
    register, done = read(places), Transferred()
    for participant in sorted(register.participants):
        folder = places.raw(participant)
        unfinished = _unfinished(folder)
        for path in sorted(path for path in folder.glob("*") if path.is_file()):
            name = f"{participant}/{path.name}"
            if path.name.startswith(".") or any(path.name.startswith(ses) for ses in unfinished):
                continue
            _one(places, store, register, name, path, done)
        done.only_here += [f"{participant}/{ses}: not finished" for ses in sorted(unfinished)]
    done.only_here += [
        f"{folder.name}: not of a participant in the register; pilots and simulations stay here"
        for folder in sorted(places.root.iterdir())
        if folder.is_dir() and folder.name not in register.participants
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
    with changed(places) as register:
        left, reach = [], Reach()
        for owed in register.owed:
            folder = Path(owed.folder)
            if not folder.is_dir():
                left.append(owed)
            elif owed.files:
                for name, people in owed.files.items():
                    edit_file(folder / name, people, owed.participant, owed.to, reach)
            elif (copies := in_store(folder, register.study, owed.participant)).is_dir():
                shutil.rmtree(copies)
        register.owed = left


def _unfinished(folder: Path) -> set[str]:
    """Return the prefixes of sessions whose journals are not, or not wholly, in the file."""
    found = {path.name.split("_")[0] for path in folder.glob("ses-*_*.xdf")}
    return {ses for ses in found if not is_recovered(folder, int(ses.removeprefix("ses-")))}
