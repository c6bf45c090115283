"""Measures of a participant that are worked out once and kept beside the participant file.

What is kept is found by a digest of everything it depends on: the bytes of the participant file,
the program of labcrane, the libraries that compute, and the settings. Whatever changes, another
name is looked for, so that nothing kept is ever out of date. No name of a participant is in it.
"""

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.errors import RecordingError
from labcrane.files.atomic import replacing

if TYPE_CHECKING:
    import pandas as pd

FOLDER = ".measures"
"""Beside the participant file: it goes when the participant's folder does."""

LIBRARIES = ("numpy", "pandas", "pyarrow", "scipy")


def kept(
    path: Path, about: Mapping[str, object], make: "Callable[[], pd.DataFrame]"
) -> "pd.DataFrame":
    """Return what ``make`` returns of the participant file; made only when it is not kept yet.

    ``about`` is what else it depends on, ready for JSON.
    """
    import pandas as pd

    place = path.parent / FOLDER / f"{_key(path, about)}.parquet"
    try:
        return pd.read_parquet(place)
    except (OSError, ValueError):  # not there, or not whole: ArrowInvalid is a ValueError
        table = make()
    if os.access(path.parent, os.W_OK):
        _keep(place, table)
    return table


def _keep(place: Path, table: "pd.DataFrame") -> None:
    """Keep a table, alone: what was kept before is of another file or another program."""
    try:
        with replacing(place) as beside:
            table.to_parquet(beside, index=False)
        for other in place.parent.glob("*.parquet"):
            if other != place:
                other.unlink(missing_ok=True)
    except (RecordingError, OSError, ValueError, TypeError):
        # A full disk, or a column of numbers in one session and words in another, which is nothing
        # for Parquet, keeps nobody from results that are there already.
        return


def _key(path: Path, about: Mapping[str, object]) -> str:
    with path.open("rb") as file:
        content = hashlib.file_digest(file, "sha256").hexdigest()
    depends = {"file": content, "program": program(), **about}
    return hashlib.sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()[:32]


@cache
def program() -> str:
    """Return a digest of the source of labcrane and of the versions of what computes."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    for source in sorted(root.rglob("*.py")):
        digest.update(source.relative_to(root).as_posix().encode() + b"\0" + source.read_bytes())
    for library in LIBRARIES:
        digest.update(f"{library} {version(library)}".encode())
    return digest.hexdigest()
