"""Settings of exports as tables."""

from typing import Literal

from labcrane import Settings


class TableSettings(Settings):
    """Settings of :class:`~labcrane_tables.tables.Tables`."""

    streams: Literal["parquet", "csv", "both", "none"] = "parquet"
    """How streams, one row per tick, are written. Parquet is small and fast; R reads it with the
    package arrow or nanoparquet. Gzipped CSV needs no package, but takes ten times as long."""

    films: bool = False
    """Whether the films of cameras, microphones and screens are copied, too. Faces and voices are
    personal data."""


class ArchiveSettings(Settings):
    """Settings of :class:`~labcrane_tables.archive.Archive`."""

    license: str
    """SPDX name of the data's licence: ``CC-BY-4.0``, ``CC0-1.0``."""

    authors: tuple[str, ...] = ()
    """Who made the data set."""

    description: str = ""
    """What the study is about; its title by default."""

    recordings: bool = True
    """Whether to include the participant files, with every tick; otherwise the archive contains
    only tables of trials, answers and scores."""


class PsychDsSettings(Settings):
    """Settings of :class:`~labcrane_tables.psychds.PsychDs`."""

    description: str = ""
    """What the study is about; its title by default."""
