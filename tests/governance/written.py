"""Files that are in the register and were written by a test."""

from collections.abc import Iterable, Mapping
from datetime import date
from pathlib import Path

from labcrane.participants.copies import enter, kept_folder
from labcrane.participants.folders import Places
from labcrane.participants.register import Export, changed


def record_export(
    places: Places,
    exporter: str,
    folder: Path,
    files: Mapping[Path, Iterable[str]],
    today: date,
) -> None:
    """Enter files into the register; ``files`` says whose data are in each."""
    folder = folder.resolve()
    entry = Export(
        date=today.isoformat(),
        exporter=exporter,
        folder=kept_folder(places, folder),
        files={
            (folder / path).relative_to(folder).as_posix(): sorted(set(names))
            for path, names in files.items()
        },
        people=sorted({name for names in files.values() for name in names}),
    )
    with changed(places) as register:
        enter(places, register, entry)
