"""Export of recordings as tables: CSV and Parquet for R and pandas, Psych-DS, an archive."""

from collections.abc import Sequence

from labcrane import Machine, Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_tables.settings import ArchiveSettings, PsychDsSettings, TableSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    def tables(settings: TableSettings, machine: Machine) -> Exporter:
        from labcrane_tables.tables import Tables

        return Tables(settings)

    def psychds(settings: PsychDsSettings, machine: Machine) -> Exporter:
        from labcrane_tables.psychds import PsychDs

        return PsychDs(settings)

    def archive(settings: ArchiveSettings, machine: Machine) -> Exporter:
        from labcrane_tables.archive import Archive

        return Archive(settings)

    return (
        offer("zip", ArchiveSettings, archive),
        offer("tables", TableSettings, tables),
        offer("psychds", PsychDsSettings, psychds),
    )
