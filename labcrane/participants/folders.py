"""Folders for personal data, raw data and exports in a study's data folder.

::

    data/
      register/            who takes part, consent, exclusions: personal data
      P001/                raw data: journals and participant file
      P001-PILOT/ ...      the same of pilots and simulations
      exports/             what labcrane made of them for others

All of it is for the user only.
"""

import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from labcrane.errors import RecordingError
from labcrane.files.atomic import PRIVATE_FILE, PRIVATE_FOLDER
from labcrane.recording.data_folder import DataFolder


@dataclass(frozen=True, slots=True)
class Places:
    """The folders of one study's data.

    Raises
    ------
    RecordingError
        ``root`` is a file.
    """

    root: Path

    def __post_init__(self) -> None:
        if self.root.is_file():
            raise RecordingError(
                f"{self.root} is a file; give the folder that holds the study's data"
            )

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
        """Default folder of exports."""
        return self.root / "exports"

    def raw(self, participant: str) -> Path:
        """Return the folder of a participant's recordings."""
        return DataFolder(self.root, participant, pilot=False, simulated=False).path

    def all_raw(self, participant: str) -> list[Path]:
        """Return the folders of a participant's recordings, pilots and simulations as well."""
        folders = self._with_stamps(participant)
        return [folder for folder in folders if folder.is_dir() and not folder.is_symlink()]

    def links(self, participant: str) -> list[Path]:
        """Return links in the places of such folders; they are never followed."""
        return [folder for folder in self._with_stamps(participant) if folder.is_symlink()]

    def _with_stamps(self, participant: str) -> list[Path]:
        return [
            DataFolder(self.root, participant, pilot, simulated).path
            for pilot in (False, True)
            for simulated in (False, True)
        ]

    def files(self) -> Iterator[Path]:
        """Yield every file below the data folder; links are left out."""
        return (path for path in entries(self.root) if path.is_file())


def entries(folder: Path) -> Iterator[Path]:
    """Yield every file and folder below a folder; links and their targets are left out."""
    for place, folders, files in os.walk(folder, followlinks=False):
        folders.sort()
        for name in sorted([*folders, *files]):
            path = Path(place) / name
            if not path.is_symlink():
                yield path


def keep_private(folder: Path) -> None:
    """Remove the permissions of all other users on ``folder`` and its content.

    Links and their targets stay unchanged.
    """
    for path in (folder, *entries(folder)):
        wanted = PRIVATE_FOLDER if path.is_dir() else PRIVATE_FILE
        if stat.S_IMODE(path.stat().st_mode) & ~wanted:
            path.chmod(wanted)
