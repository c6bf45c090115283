"""Export of recordings as tables: CSV and Parquet for R and pandas, Psych-DS, an archive."""

from labcrane import Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_tables.settings import ArchiveSettings, PsychDsSettings, TableSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> list[Offer[Exporter]]:
    return [
        offer("zip", ArchiveSettings, "labcrane_tables.archive:Archive"),
        offer("tables", TableSettings, "labcrane_tables.tables:Tables"),
        offer("psychds", PsychDsSettings, "labcrane_tables.psychds:PsychDs"),
    ]
