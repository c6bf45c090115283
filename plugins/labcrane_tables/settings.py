"""Settings of exports as tables."""

from typing import Literal

from labcrane import Settings


class TableSettings(Settings):
    """Settings of :class:`~labcrane_tables.tables.Tables`."""

    streams: Literal["parquet", "csv", "both", "none"] = "parquet"
    """How streams, one row per tick, are written. Parquet is small and fast; R reads it with the
    package arrow or nanoparquet. CSV, gzipped, is read without any, and takes ten times as long."""


class PsychDsSettings(Settings):
    """Settings of :class:`~labcrane_tables.psychds.PsychDs`."""

    description: str = ""
    """What the study is about; its title by default."""
