"""Folders for personal data, raw data and exports in a study's data folder.

::

    data/
      register/            who takes part, consent, exclusions: personal data
      P001/                raw data: journals and participant file
      P001-PILOT/ ...      the same of pilots and simulations
      exports/             what labcrane made of them for others

All of it is for the user only.
"""

import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from labcrane.files.atomic import PRIVATE_FILE, PRIVATE_FOLDER
from labcrane.recording.data_folder import DataFolder


@dataclass(frozen=True, slots=True)
class Places:
    """The folders of one study's data."""

    root: Path

    @property
    def register(self) -> Path:
        """The register's file."""
        return self.root / "register" / "register.json"

    @property
    def register_lock(self) -> Path:
        """Held while the register is changed."""
        return self.root / "register" / "register.lock"

    @property
    def work_lock(self) -> Path:
        """Held while data are erased, relabelled or transferred."""
        return self.root / "register" / "work.lock"

    @property
    def exports(self) -> Path:
        """Where exports go unless told otherwise."""
        return self.root / "exports"

    def raw(self, participant: str) -> Path:
        """Return the folder of a participant's recordings."""
        return DataFolder(self.root, participant, pilot=False, simulated=False).path

    def all_raw(self, participant: str) -> list[Path]:
        """Return the folders of a participant's recordings, pilots and simulations as well."""
        folders = [
            DataFolder(self.root, participant, pilot, simulated).path
            for pilot in (False, True)
            for simulated in (False, True)
        ]
        return [folder for folder in folders if folder.is_dir()]

    def files(self) -> Iterator[Path]:
        """Yield every file below the data folder."""
        return (path for path in sorted(self.root.rglob("*")) if path.is_file())


def keep_private(folder: Path) -> None:
    """Take all permissions on ``folder`` and what is in it from everybody but the user."""
    for path in (folder, *folder.rglob("*")):
        wanted = PRIVATE_FOLDER if path.is_dir() else PRIVATE_FILE
        if stat.S_IMODE(path.stat().st_mode) & ~wanted:
            path.chmod(wanted)
