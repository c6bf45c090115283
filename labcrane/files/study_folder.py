"""The folder of a study: its protocol, and ``data`` beside it, by whichever of them is given."""

import re
from collections.abc import Iterator
from pathlib import Path

from labcrane.errors import ProtocolError, RecordingError

PROTOCOL = "protocol.yaml"
DATA = "data"
YAML = (".yaml", ".yml")
OURS = re.compile(rb"^labcrane\s*:", re.MULTILINE)
"""The key that every protocol has, and no other file of a study."""


def protocol_of(path: Path) -> Path:
    """Return the protocol of what was given: itself, a study's folder, or the data folder in that.

    In a folder it is ``protocol.yaml``, or the only protocol that is there.

    Raises
    ------
    ProtocolError
        A folder was given that has no protocol, or several of which none is ``protocol.yaml``.
    """
    if not path.is_dir():
        return path
    beside = [path.absolute().parent] if path.absolute().name == DATA else []
    for folder in (path, *beside):
        if (usual := folder / PROTOCOL).is_file():
            return usual
        found = sorted(_protocols(folder))
        if len(found) == 1:
            return found[0]
        if found:
            names = ", ".join(each.name for each in found)
            raise ProtocolError(f"{folder.absolute()} holds several protocols, {names}; give one")
    raise ProtocolError(
        f"there is no {PROTOCOL} in {path.absolute()}, nor another protocol; give the study's YAML "
        "file or its folder"
    )


def data_of(path: Path) -> Path:
    """Return the data folder of what was given: a protocol, a study's folder, or the data itself.

    Raises
    ------
    RecordingError
        It is none of them.
    """
    if path.suffix in YAML and path.is_file():
        return path.parent / DATA
    if not path.exists():
        raise RecordingError(
            f"there is no folder {path}; give the study's folder, its protocol or its data folder"
        )
    if (path / DATA).is_dir():
        return path / DATA
    if path.is_dir() and any(_protocols(path)):
        return path / DATA
    if not path.is_dir() or path.absolute().name == DATA or _has_data(path):
        return path
    raise RecordingError(
        f"{path.absolute()} is not the folder of a study: it has no protocol, no folder {DATA}, "
        "no register and no recording; give the study's folder, its protocol or its data folder"
    )


def _protocols(folder: Path) -> Iterator[Path]:
    """Yield the protocols in a folder."""
    for path in folder.iterdir():
        if path.suffix in YAML and path.is_file() and OURS.search(path.read_bytes()):
            yield path


def _has_data(folder: Path) -> bool:
    """Say whether a folder holds a register, participants, or a participant's recordings."""
    marks = ("register", "*.h5", "*.xdf", "*/*.h5", "*/*.xdf")
    return any(any(folder.glob(mark)) for mark in marks)
