"""Earlier movements of this person and of the others of the study, from their participant files."""

import contextlib
import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from labcrane.errors import LabcraneError
from labcrane.participants.folders import Places
from labcrane.participants.register import struck
from labcrane.recording.data_folder import DataFolder

FEWEST = 3
"""Minimum size of a cohort that is shown: with fewer, the band would reveal a person."""

MOST = 200
"""People of whom a cohort is made at most."""


@dataclass
class Earlier:
    """What was measured before, by the name of the measure.

    Attributes
    ----------
    mine
        Of this person's earlier sessions, in order.
    others
        A median of each other person.
    """

    mine: dict[str, list[float]] = field(default_factory=dict)
    others: dict[str, list[float]] = field(default_factory=dict)

    def cohort(self, measure: str) -> tuple[float, float, float, int] | None:
        """Return the quartiles of the others' medians and how many there are; None of too few."""
        medians = self.others.get(measure, [])
        if len(medians) < FEWEST:
            return None
        low, middle, high = np.percentile(medians, [25, 50, 75]).tolist()
        return low, middle, high, len(medians)


def read_behind(folder: Path, study: str, session: int, measures: Iterable[str]) -> Earlier:
    """Return the results of the other participants next to ``folder``; a thread reads them.

    Only folders with the same stamps as this one's count: pilots are not compared with people. Who
    was excluded counts nowhere.
    """
    found = Earlier()
    wanted = tuple(measures)
    if wanted:
        threading.Thread(
            target=_read, args=(found, folder, study, session, wanted), name="earlier", daemon=True
        ).start()
    return found


def _read(found: Earlier, folder: Path, study: str, session: int, wanted: tuple[str, ...]) -> None:
    stamps = folder.name.removeprefix(DataFolder.pseudonym(folder.name))
    try:
        left_out = struck(Places(folder.parent))
    except LabcraneError:  # exclusions are unknown, so no cohort is shown
        return
    others = [
        file
        for file in sorted(folder.parent.glob("*/*.h5"))
        if file.stem == (name := file.parent.name)
        and name.removeprefix(DataFolder.pseudonym(name)) == stamps
        and name not in left_out
        and file.parent != folder
    ]
    for file in (folder / f"{folder.name}.h5", *others[:MOST]):
        with contextlib.suppress(LabcraneError, OSError, KeyError):  # it is for orientation only
            _take(found, file, study, wanted, session if file.parent == folder else None)


def _take(
    found: Earlier, file: Path, study: str, wanted: tuple[str, ...], mine: int | None
) -> None:
    from labcrane.recording.participant_file.reader import Recording  # noqa: PLC0415 - heavy

    values: dict[str, list[float]] = {}
    for record in Recording(file):  # of this participant it is behind
        if record.attrs.get("study") != study:
            continue
        if mine is not None and int(record.attrs["session"]) >= mine:
            continue
        trials = record.trials
        for measure in set(wanted) & set(trials):
            column = trials[measure].to_numpy(float)
            values.setdefault(measure, []).extend(column[np.isfinite(column)].tolist())
    for measure, measured in values.items():
        if measured and mine is not None:
            found.mine.setdefault(measure, []).extend(measured)
        elif measured:
            found.others.setdefault(measure, []).append(float(np.median(measured)))
