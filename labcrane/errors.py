"""Every error labcrane raises on purpose.

LabcraneError
├── ProtocolError    the YAML asks for something impossible; nothing has run
├── PluginError      a plugin is missing, broken, or broke its contract
├── DeviceError      hardware is absent or stopped answering
├── StreamError      LSL is set up wrongly, or a stream is missing or broken
└── RecordingError   a file cannot be written, or has unexpected content
    └── StorageError     the disk or another program refuses it, whatever its content is

A late tick is not an error: it is data, and is recorded with the frame.
"""

from collections.abc import Iterable, Sequence


class LabcraneError(Exception):
    """Base of every deliberate labcrane error; the CLI prints it without a traceback."""


class ProtocolError(LabcraneError):
    """The study protocol, or a request about it, cannot be run as written.

    Parameters
    ----------
    at
        The keys and indices that lead to the mistake, counted from the part being read or built:
        ``at=("distances", 2)``. A check points there.
    """

    def __init__(self, message: str = "", *, at: Sequence[str | int] = ()) -> None:
        super().__init__(message)
        self.at = tuple(at)


class PluginError(LabcraneError):
    """A plugin is missing, failed to import, or broke its contract."""


class DeviceError(LabcraneError):
    """A device is absent or stopped answering."""


class StreamError(LabcraneError):
    """LSL is not set up as asked, or a stream is missing or broken."""


class RecordingError(LabcraneError):
    """A recording cannot be written, found or read."""


class StorageError(RecordingError):
    """The disk, or another program, refuses a file, whatever is in it."""

    @classmethod
    def of(cls, error: OSError) -> "StorageError":
        """Return the computer's message about a file, and what to do."""
        where = error.filename or "a file"
        return cls(
            f"{where}: {error.strerror or error}; nothing recorded is affected: make room, close "
            "the program that holds it, or give another place"
        )


class OutdatedRecordingWarning(UserWarning):
    """A participant file is read that lacks something of the journals beside it."""


MOST_LISTED = 40
"""Most names that a message lists with the suggested one."""


def suggestion(word: str, known: Iterable[str], otherwise: str = "there is") -> str:
    """Return the known word that is closest, as a question; all of them when none is close."""
    possible = list(known)
    return meant(word, possible) or f"{otherwise} {', '.join(possible) or 'none'}"


def nearest(word: str, known: Iterable[str], there: str) -> str:
    """Return the known word that is closest, as a question where one is close, and all of them."""
    names = list(known)
    listed = ", ".join(names) or "none"
    close = meant(word, names)
    if close and len(names) > MOST_LISTED:
        listed = f"{', '.join(names[:MOST_LISTED])} and {len(names) - MOST_LISTED} more"
    return f"{close} {there} {listed}".lstrip()


def meant(word: str, known: Sequence[str]) -> str:
    """Return the known word that is closest, as a question; nothing when none is close."""
    from difflib import get_close_matches  # noqa: PLC0415 - only a mistake needs it

    close = get_close_matches(word, known, n=1)
    return f"did you mean {close[0]!r}?" if close else ""
