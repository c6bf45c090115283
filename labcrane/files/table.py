"""Text of a CSV table that others made, gzipped or not: bounded before it is read."""

import gzip
import zlib
from pathlib import Path

from labcrane.files.system import is_file
from labcrane.limits import LIMITS, LimitError, check_size

PACKED = b"\x1f\x8b"
"""How a gzipped file begins, whatever its name."""


def read_csv_text(path: Path) -> str:
    """Return the content of a file with a CSV table, unpacked.

    Raises
    ------
    OSError
        It cannot be read.
    ValueError
        The file is too large for a table, not UTF-8, or a damaged gzip file; the message says
        which.
    """
    most = LIMITS["CSV table"].most
    if not is_file(path):
        raise LimitError("it is not a file")
    check_size(path.stat().st_size, "CSV table", "it")
    with path.open("rb") as file:
        packed = file.read(len(PACKED)) == PACKED
        file.seek(0)
        try:
            content = gzip.GzipFile(fileobj=file).read(most + 1) if packed else file.read(most + 1)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise LimitError(f"it is gzipped, and damaged: {error}; copy it again") from error
    if len(content) > most:
        raise LimitError(f"it has more than {most} bytes once it is unpacked; split it up")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise LimitError(
            f"byte 0x{content[error.start]:02X} in line {line} is not UTF-8; save it as UTF-8"
        ) from error
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise LimitError(f"line {line} contains a NUL character; remove it")
    return text
