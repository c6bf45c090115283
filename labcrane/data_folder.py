"""Where a study's recordings are: one folder per participant."""

import os
import re
from dataclasses import dataclass
from pathlib import Path

from labcrane.errors import ProtocolError, RecordingError


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
        """The participant's name with its stamps."""
        stamps = ["PILOT"] * self.pilot + ["SIMULATED"] * self.simulated
        return "-".join([self.participant, *stamps])

    @property
    def path(self) -> Path:
        """The participant's folder."""
        return self.root / self.name

    @property
    def participant_file(self) -> Path:
        """The HDF5 file with all sessions."""
        return self.path / f"{self.name}.h5"

    def journal(self, session: int) -> Path:
        """Return the journal of the session process."""
        return self.path / f"ses-{session:02}_run.xdf"

    def sessions(self) -> list[int]:
        """Return the sessions of which there is a journal."""
        found = (re.match(r"ses-(\d+)_", entry.name) for entry in self.path.glob("ses-*_*.xdf"))
        return sorted({int(match[1]) for match in found if match})

    def claim(self, session: int) -> None:
        """Make the folder, and make sure that ``session`` can be recorded in it.

        Raises
        ------
        ProtocolError
            The session has been recorded already: nothing is ever overwritten.
        RecordingError
            The folder cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(self._cannot_write(error.strerror)) from error
        if not os.access(self.path, os.W_OK | os.X_OK):
            raise RecordingError(self._cannot_write("permission denied"))
        if session in self.sessions():
            done = ", ".join(map(str, self.sessions()))
            raise ProtocolError(
                f"participant {self.name} has already run session {session} (recorded in "
                f"{self.path}: {done}); check the number, or give the next session"
            )

    def _cannot_write(self, why: str | None) -> str:
        return f"data folder {self.path} cannot be written: {why}; give another with --data"
