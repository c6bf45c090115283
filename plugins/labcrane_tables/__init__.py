"""Exports recordings as tables: CSV and Parquet for R and pandas, and Psych-DS."""

from collections.abc import Sequence

from labcrane import Machine, Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_tables.settings import PsychDsSettings, TableSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    def tables(settings: TableSettings, machine: Machine) -> Exporter:
        from labcrane_tables.tables import Tables

        return Tables(settings)

    def psychds(settings: PsychDsSettings, machine: Machine) -> Exporter:
        from labcrane_tables.psychds import PsychDs

        return PsychDs(settings)

    return (
        offer("tables", TableSettings, tables),
        offer("psychds", PsychDsSettings, psychds),
    )
