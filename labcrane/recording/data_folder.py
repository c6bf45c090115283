"""Data folder of a study: one folder per participant."""

import os
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from labcrane.errors import ProtocolError, RecordingError
from labcrane.files.atomic import make_folder
from labcrane.files.names import check_name, twin_key
from labcrane.recording.paths import participant_path


def needed_bytes(expected_s: float, bytes_per_s: float, reserve_s: float) -> float:
    """Return the space for a session of twice the expected length, and its reserve."""
    return (2.0 * expected_s + reserve_s) * bytes_per_s


def recorded(root: Path) -> list[Path]:
    """Return the folders below ``root`` with recordings, pilots and simulations too, by name."""
    if not root.is_dir():
        return []
    return [folder for folder in sorted(root.iterdir()) if _is_recorded(folder)]


def _is_recorded(folder: Path) -> bool:
    if not folder.is_dir():
        return False
    return participant_path(folder).exists() or any(folder.glob("ses-*.xdf"))


@dataclass(frozen=True, slots=True)
class DataFolder:
    """The recordings of one participant.

    A pilot's or a simulated participant's are kept apart from those of people, under a name that
    says so: ``P001-PILOT``, ``P001-SIMULATED``.

    Attributes
    ----------
    root
        The study's data folder.
    participant
        Pseudonym.
    pilot, simulated
        Whether this is a trial run, and whether a program operates the machine.
    """

    root: Path
    participant: str
    pilot: bool
    simulated: bool

    @property
    def name(self) -> str:
        """The participant's name with its suffixes."""
        stamps = ["PILOT"] * self.pilot + ["SIMULATED"] * self.simulated
        return "-".join([self.participant, *stamps])

    @staticmethod
    def pseudonym(name: str) -> str:
        """Return the pseudonym in a ``name`` with suffixes."""
        return name.removesuffix("-SIMULATED").removesuffix("-PILOT")

    @staticmethod
    def is_simulated(name: str) -> bool:
        """Return whether a ``name`` with suffixes is of data that a program made."""
        return name.endswith("-SIMULATED")

    @staticmethod
    def options(name: str) -> str:
        """Return the options by which a command means the recordings of a ``name`` with suffixes.

        ``P001-SIMULATED`` is ``--participant P001 --simulate``.
        """
        pseudonym = DataFolder.pseudonym(name)
        pilot = " --pilot" * name.removesuffix("-SIMULATED").endswith("-PILOT")
        simulate = " --simulate" * DataFolder.is_simulated(name)
        return f"--participant {pseudonym}{pilot}{simulate}"

    @property
    def path(self) -> Path:
        """The participant's folder."""
        return self.root / self.name

    @property
    def participant_file(self) -> Path:
        """The HDF5 file with all sessions."""
        return participant_path(self.path)

    def sessions(self) -> list[int]:
        """Return the sessions that have been begun: those with a journal of their own."""
        found = (re.match(r"ses-(\d+)_", entry.name) for entry in self.path.glob("ses-*_run*.xdf"))
        return sorted({int(match[1]) for match in found if match})

    def make(self) -> None:
        """Make the folder, if it is not there.

        Raises
        ------
        RecordingError
            It cannot be written.
        """
        if not self.path.is_dir():  # of a recording that was begun before there was a white list
            check_name(self.participant, "participant")
        self._refuse_twin()
        if self.path.is_symlink():
            raise RecordingError(
                f"{self.path} is a link, and links are never followed: what is behind it could "
                "not be erased; move the folder itself here, or give another with --data"
            )
        try:
            make_folder(self.path)
        except OSError as error:
            raise RecordingError(self._cannot_write(error.strerror)) from error
        if not os.access(self.path, os.W_OK | os.X_OK):
            raise RecordingError(self._cannot_write("permission denied"))

    def _refuse_twin(self) -> None:
        """Refuse a name that some disk or format would take for that of another folder here."""
        key = twin_key(self.name)
        there = self.root.iterdir() if self.root.is_dir() else ()
        for folder in there:
            if folder.name != self.name and folder.is_dir() and twin_key(folder.name) == key:
                raise ProtocolError(
                    f"participant {self.name} and {folder.name}, who is here already, would be "
                    "the same on some disks and in some formats; check the pseudonym"
                )

    def check_space(self, expected_s: float, bytes_per_s: float, reserve_s: float) -> None:
        """Make sure that a session of twice the expected length fits, and its reserve.

        Raises
        ------
        RecordingError
            It does not; says how much there is, and how much is needed.
        """
        needed = needed_bytes(expected_s, bytes_per_s, reserve_s)
        free = shutil.disk_usage(self.path).free
        if free < needed:
            raise RecordingError(
                f"the session needs up to {needed / 1e6:.0f} MB (twice its expected "
                f"{expected_s / 60:.0f} minutes, and {reserve_s:.0f} s in reserve), and only "
                f"{free / 1e6:.0f} MB are free at {self.path}; free some space, or give another "
                "folder with --data"
            )

    def _cannot_write(self, why: str | None) -> str:
        return f"data folder {self.path} cannot be written: {why}; give another with --data"
