"""Columns of numbers that are written a chunk at a time, as long as they come.

A chunk is shuffled and packed here, and given to HDF5 as it goes to the disk: what any HDF5 reads
as gzip, by a packer that is ten times as fast as zlib's (ISA-L).
"""

from typing import TYPE_CHECKING

import numpy as np

from labcrane.recording.participant_file.columns import (
    CHUNK,
    COMPRESS_FROM,
    GZIP_LEVEL,
    write_attributes,
)
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import h5py


class ColumnWriter:
    """Columns of one length, filled from their first row to their last.

    Parameters
    ----------
    group
        Below which they are.
    columns
        Path and unit of each.
    count
        How many rows there will be.
    """

    def __init__(self, group: "h5py.Group", columns: "list[tuple[str, str]]", count: int) -> None:
        packed = count >= COMPRESS_FROM
        self._chunk = min(count, CHUNK) if packed else count
        how = {"chunks": (self._chunk,), "compression": "gzip", "compression_opts": GZIP_LEVEL}
        options = how | {"shuffle": True} if packed else {}
        self._packed = packed
        self._datasets = []
        for path, unit in columns:
            dataset = group.create_dataset(path, (count,), np.float64, **options)
            write_attributes(dataset, {"unit": unit})
            self._datasets.append(dataset)
        self._buffer = np.zeros((len(columns), self._chunk))
        self._filled = 0
        self._written = 0
        self._count = count

    def write(self, rows: FloatArray) -> None:
        """Write further rows, shape ``(n, n_columns)``."""
        done = 0
        while done < len(rows):
            more = min(len(rows) - done, self._chunk - self._filled)
            self._buffer[:, self._filled : self._filled + more] = rows[done : done + more].T
            self._filled += more
            done += more
            if self._filled == self._chunk:
                self._flush()

    def close(self) -> None:
        """Write what is left.

        Raises
        ------
        ValueError
            There were fewer rows than were said.
        """
        if self._filled:
            self._flush()
        if self._written != self._count:
            raise ValueError(f"{self._written} of {self._count} rows were written")

    def _flush(self) -> None:
        if self._packed:
            self._buffer[:, self._filled :] = 0.0
            for dataset, values in zip(self._datasets, self._buffer, strict=True):
                dataset.id.write_direct_chunk((self._written,), pack(values))
        else:
            for dataset, values in zip(self._datasets, self._buffer, strict=True):
                dataset[:] = values
        self._written += self._filled
        self._filled = 0


def pack(values: FloatArray) -> bytes:
    """Return one chunk as HDF5's filters shuffle and gzip leave it."""
    shuffled = np.ascontiguousarray(values.view(np.uint8).reshape(-1, values.itemsize).T)
    from isal import isal_zlib  # noqa: PLC0415 - who only reads a recording does without

    packed: bytes = isal_zlib.compress(shuffled, GZIP_LEVEL)
    return packed
