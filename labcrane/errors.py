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
    close = meant(word, names)
    listed = shortened(names, MOST_LISTED if close else len(names)) or "none"
    return f"{close} {there} {listed}".lstrip()


def shortened(names: Sequence[str], most: int, between: str = ", ") -> str:
    """Return names in a row: the first of many, and how many more there are."""
    more = len(names) - most
    return between.join(names[:most]) + (f" and {more} more" if more > 0 else "")


def meant(word: str, known: Sequence[str]) -> str:
    """Return the known word that is closest, as a question; nothing when none is close."""
    from difflib import get_close_matches  # noqa: PLC0415 - only a mistake needs it

    for other in known:
        if look(other) == look(word):
            return f"did you mean {other!r}? {unlike(word, other)}"
    close = get_close_matches(word, known, n=1)
    return f"did you mean {close[0]!r}?" if close else ""


LATIN = str.maketrans(
    "\u0391\u0392\u0395\u0396\u0397\u0399\u039a\u039c\u039d\u039f\u03a1\u03a4\u03a5\u03a7\u03bf"
    "\u0410\u0412\u0415\u041a\u041c\u041d\u041e\u0420\u0421\u0422\u0425\u0405\u0406\u0408"
    "\u0430\u0435\u043e\u0440\u0441\u0443\u0445\u0455\u0456\u0458",
    "ABEZHIKMNOPTYXoABEKMHOPCTXSIJaeopcyxsij",
)
"""Greek and Cyrillic letters that look like Latin ones."""


def look(name: str) -> str:
    """Return a key that is equal for names that look alike.

    Accents as letters' parts or beside them, signs that are not seen, blanks, and letters of other
    scripts that look Latin.
    """
    if name.isascii():
        return " ".join(name.split())
    import unicodedata  # noqa: PLC0415 - most names need none

    whole = unicodedata.normalize("NFC", name)
    seen = (each for each in whole if unicodedata.category(each) != "Cf")
    return " ".join("".join(seen).split()).translate(LATIN)


def unlike(name: str, other: str) -> str:
    """Return in which code points two names differ that look alike."""
    one, two = (
        " ".join(f"U+{ord(each):04X}" for each in dict.fromkeys(own) if each not in against)
        for own, against in ((name, other), (other, name))
    )
    differences = f"{name!a} has {one or 'other blanks'}"
    return f"They look alike, but {differences}" + (f", and {other!a} has {two}" if two else "")
