"""Names that become parts of paths: of participants, studies, streams and files.

One white list for all of them, so that whatever passes at the door can be recorded, exported,
copied to any disk, relabelled and erased.
"""

import re
import unicodedata
from hashlib import sha256
from pathlib import Path

from labcrane.errors import ProtocolError, meant
from labcrane.files.system import is_folder

LONGEST = 40
"""Most characters of a name; file names are made of several, and some disks take 143 in all."""

ALLOWED = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9_-]*[A-Za-z0-9])?")

STAMPS = ("PILOT", "SIMULATED")
"""Suffixes of a pseudonym, after a hyphen, for sessions that are not a participant's."""

OURS = frozenset(
    {
        "register", "exports", "pool", "evaluation", "labcrane", "labcrane-report", "report",
        "simulation", "participants", "participant", "session", "sessions", "ses", "sub", "run",
        "streams", "stream", "trials", "trial", "events", "event", "figures", "tables", "table",
        "phenotype", "motion", "beh", "eeg", "physio", "code", "data", "derivatives", "sourcedata",
        "stimuli", "nan", "none", "null", "true", "false",
    }
)  # fmt: skip
"""Folders, files and words of our own records: not allowed as pseudonyms."""

DEVICES = frozenset(
    ["con", "prn", "aux", "nul", "conin", "conout", "clock"]
    + [f"{port}{number}" for port in ("com", "lpt") for number in range(10)]
)
"""Names that no file can have on Windows, with any ending."""

MISSING = frozenset(
    {
        "NA", "N/A", "n/a", "NaN", "nan", "-NaN", "-nan", "NULL", "null", "None", "<NA>", "#NA",
        "#N/A", "#N/A N/A", "-1.#IND", "1.#IND", "-1.#QNAN", "1.#QNAN",
    }
)  # fmt: skip
"""Words that pandas, R or BIDS read as a missing value by default."""

READ_OTHERWISE = frozenset({"f", "inf", "infinity", "na", "t"})
"""Pseudonyms that tables do not hold as text."""

HASHED = 8

COHORT = "cohort.yaml"
"""Name of a simulated population's file in the protocol's folder."""


def check_name(name: str, what: str) -> str:
    """Return a name unchanged, if it can be part of a path everywhere.

    Parameters
    ----------
    what
        Whose name it is, for the message.

    Raises
    ------
    ProtocolError
        It cannot.
    """
    if why := misfit(name):
        raise ProtocolError(f"{what} {name!r} {why}")
    return name


def misfit(name: str, *, person: bool = True) -> str | None:
    """Return why a name cannot be part of a path everywhere, and what to do; None if it can.

    Parameters
    ----------
    person
        Whether it is a participant's: those are next to our own folders, and have suffixes.
    """
    if not ALLOWED.fullmatch(name):
        return (
            "cannot be the name of a folder everywhere; take letters A to Z, digits, and hyphens "
            "or underscores between them"
        )
    if len(name) > LONGEST:
        return f"has {len(name)} characters; take {LONGEST} at most"
    low = name.lower()
    if low in DEVICES:
        return "is a device name on Windows; use another name"
    if not person:
        return None
    if low in READ_OTHERWISE:
        return "is read by R or pandas as a missing value, a truth or infinity; use another name"
    if low in OURS:
        return "is reserved for labcrane's own files; use another name"
    for stamp in STAMPS:
        if low.endswith(f"-{stamp.lower()}"):
            return f"ends in -{stamp}, which labcrane adds itself; remove it"
    return None


def twin_key(name: str) -> str:
    """Return a key that is equal for two names that some disk or format treats as the same.

    Upper and lower case, forms of the same letter, and whatever is neither letter nor digit. Names
    that are numbers are the same where the numbers are: R and pandas read 001, 01 and 1 alike, and
    R reads 0x10 as 16.
    """
    folded = unicodedata.normalize("NFKC", name).casefold()
    key = "".join(letter for letter in folded if letter.isalnum())
    number = key.removesuffix("i")  # R reads 2i as complex, and 2e as 2
    number = number.removesuffix("e") if not number.startswith("0x") else number
    try:
        value = float.fromhex(number) if number.startswith("0x") else float(number)
    except (ValueError, OverflowError):
        return key
    return f"{value!r}i" if key.endswith("i") else repr(value)


def file_name_of(text: str) -> str:
    """Return a name for a file about something that others have named: a stream, an area.

    Different texts have different names, upper and lower case apart.
    """
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", text).strip("._-")[:LONGEST].rstrip("._-")
    if name and name == text and name.lower().split(".")[0] not in DEVICES:
        return name
    return f"{name or 'x'}-{sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()[:HASHED]}"


MOST_LISTED = 10
"""Files of a folder that a message lists."""


def outside(path: Path, folder: Path) -> str | None:
    """Return that a file is not in a study's folder, and what to do; None if it is.

    A link counts as what it leads to.
    """
    if path.resolve().is_relative_to(folder.resolve()):
        return None
    return (
        f"{path.resolve()} is not in the folder of the protocol, {folder.resolve()}; put it there, "
        "so that it moves with the study and is part of its approval"
    )


def absent(path: Path) -> str:
    """Return that there is no such file, and which one in its folder may be meant."""
    beside = sorted(each.name for each in path.parent.glob("*")) if is_folder(path.parent) else []
    more = ", ..." if len(beside) > MOST_LISTED else ""
    there = f"{path.parent} has {', '.join(beside[:MOST_LISTED]) or 'none'}{more}"
    return f"there is no such file; {meant(path.name, beside) or there}"
