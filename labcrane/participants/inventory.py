"""Places with a participant's data: everything that labcrane has written, and pending erasures."""

from dataclasses import dataclass
from pathlib import Path

from labcrane.participants.copies import concerns, in_store, reachable, store_reachable, traces
from labcrane.participants.folders import Places
from labcrane.participants.register import read

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
