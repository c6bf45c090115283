"""Output folder of models, tables and figures."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from labcrane import RecordingError


@contextmanager
def written(path: Path) -> Iterator[None]:
    """Say where else a file or folder can go when the system refuses to write it.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be written: {error.strerror}; give --out another place"
        ) from error
