"""Settings of exports as tables."""

from typing import Literal

from labcrane import Settings


class TableSettings(Settings):
    """Settings of :class:`~labcrane_tables.tables.Tables`."""

    streams: Literal["both", "parquet", "csv", "none"] = "both"
    """How streams, one row per tick, are written. Parquet is small and fast; R reads it with the
    package arrow or nanoparquet, and CSV without any."""


class ArchiveSettings(Settings):
    """Settings of :class:`~labcrane_tables.archive.Archive`."""

    license: str
    """Licence under which the data are given, by its SPDX name: ``CC-BY-4.0``, ``CC0-1.0``."""

    authors: tuple[str, ...] = ()
    """Who made the data set."""

    description: str = ""
    """What the study is about; its title by default."""

    recordings: bool = True
    """Whether the participant files go in, with every tick; otherwise only tables of trials,
    answers and scores."""


class PsychDsSettings(Settings):
    """Settings of :class:`~labcrane_tables.psychds.PsychDs`."""

    description: str = ""
    """What the study is about; its title by default."""
