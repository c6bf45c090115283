"""Systems' differences in files: what Linux, macOS and Windows each do in their own way."""

import os
import shutil
import sys
from pathlib import Path

BINARY: int = getattr(os, "O_BINARY", 0)
"""Flag of ``os.open``, without which Windows writes two bytes for each byte 10."""

PRIVATE_MODES = sys.platform != "win32"
"""Whether permissions of a file keep others from reading it.

Windows has only one such permission: whether the file may be written. The access list of the folder
decides there, and new files and folders inherit it. In the user's profile it admits only the
user.
"""


def is_file(path: Path) -> bool:
    """Whether there is such a file: none has a name that no disk takes, or cannot be looked at.

    Before Python 3.14, ``Path.is_file`` raises for those; ``os.path`` never did.
    """
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: Path) -> bool:
    """Whether there is such a folder, as :func:`is_file`."""
    return os.path.isdir(path)  # noqa: PTH112


def is_there(path: Path) -> bool:
    """Whether there is such a file or folder, as :func:`is_file`."""
    return os.path.exists(path)  # noqa: PTH110


def free_bytes(path: Path) -> int:
    """Return the bytes free to this user on the disk that holds ``path``."""
    return shutil.disk_usage(path).free


def sync(fd: int) -> None:
    """Bring a file that is open for writing to the disk, with all that is needed to read it."""
    # Looked up at each call: macOS and Windows have no fdatasync.
    getattr(os, "fdatasync", os.fsync)(fd)
