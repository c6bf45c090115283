"""Data that could not be used: of a recording that is damaged, or by a fault of labcrane."""

import traceback
from dataclasses import dataclass

from labcrane.analysis.cohort import Status
from labcrane.errors import LabcraneError, ProtocolError, RecordingError, StorageError


@dataclass(frozen=True, slots=True)
class Unusable:
    """Why one participant is left out of results of many.

    Attributes
    ----------
    status
        ``UNREADABLE`` where the recording is damaged, ``FAULT`` where labcrane failed.
    why
        In words.
    trace
        The traceback of a fault, for a bug report; else empty.
    """

    status: Status
    why: str
    trace: str = ""

    @classmethod
    def of(cls, error: Exception) -> "Unusable":
        """Return why a participant is left out after an error.

        Raises
        ------
        Exception
            The error itself, where no participant is to blame: the disk, the place for the
            results, or another program.
        """
        refused = isinstance(error, OSError) and error.errno
        if refused or isinstance(error, StorageError):
            raise error
        if isinstance(error, RecordingError | ProtocolError):  # of the file, of the protocol in it
            return cls(Status.UNREADABLE, str(error))
        if isinstance(error, LabcraneError):
            raise error
        why = (
            f"a fault of labcrane, not of the recording ({error!r}); please report it with its "
            "traceback"
        )
        return cls(Status.FAULT, why, "".join(traceback.format_exception(error)))
