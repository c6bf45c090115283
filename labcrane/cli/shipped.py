"""Studies that come with labcrane, and copies of them for a laboratory to change."""

import re
import shutil
from pathlib import Path

import labcrane
from labcrane.errors import ProtocolError, suggestion
from labcrane.files.atomic import SHARED_FILE, write_text
from labcrane.protocol.protocol import STUDY_NAME

FOLDERS = ("protocols", "examples/designs", "labcrane_studies")
"""Their places relative to the package: in the repository, and in an installed wheel."""

LEFT = shutil.ignore_patterns("data", "*.lock*.json")
"""Recordings and approval of a study that was run in place; they are not copied."""


def shipped_studies() -> dict[str, Path]:
    """Return the folders of the studies that come with labcrane, by name."""
    beside = Path(labcrane.__file__).parents[1]
    found = (path.parent for name in FOLDERS for path in (beside / name).glob("*/protocol.yaml"))
    return {folder.name: folder for folder in sorted(found, key=lambda folder: folder.name)}


def new_study(shipped: str, folder: Path) -> Path:
    """Copy a study that comes with labcrane, with everything that it refers to.

    Parameters
    ----------
    shipped
        Its name.
    folder
        A new folder. The study takes its name.

    Returns
    -------
    Path
        The protocol.

    Raises
    ------
    ProtocolError
        No study has that name, the folder's name cannot name a study, or the folder exists.
    """
    known = shipped_studies()
    if shipped not in known:
        raise ProtocolError(
            f"no study {shipped!r} comes with labcrane; {suggestion(shipped, known)}"
        )
    name = folder.absolute().name
    if not re.fullmatch(STUDY_NAME, name):
        raise ProtocolError(
            f"{name!r} cannot name a study; give a folder whose name has lower-case letters, "
            "digits, - and _, and begins with a letter, such as my_study"
        )
    try:
        shutil.copytree(known[shipped], folder, ignore=LEFT, copy_function=shutil.copyfile)
    except FileExistsError:
        raise ProtocolError(
            f"{folder} exists already; nothing was copied; choose another folder"
        ) from None
    except OSError as error:
        raise ProtocolError(f"{folder} could not be made: {error}") from None
    named = re.compile(rf"^study: {shipped}(?=\w*$)", re.MULTILINE)
    for path in folder.glob("*.yaml"):  # the protocol, and its variants for other controls
        text = path.read_text(encoding="utf-8")
        write_text(path, named.sub(f"study: {name}", text, count=1), SHARED_FILE)
    return folder / "protocol.yaml"
