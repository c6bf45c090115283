"""Export of sessions as XDF: all streams in one file, on one clock."""

from collections.abc import Sequence

from labcrane import Machine, Offer, Settings, hookimpl, offer
from labcrane.analysis import Exporter

labcrane_api = 1


class XdfSettings(Settings):
    """Settings of :class:`~labcrane_xdf.merged.MergedXdf`; there are none."""


@hookimpl
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    def xdf(settings: XdfSettings, machine: Machine) -> Exporter:
        from labcrane_xdf.merged import MergedXdf

        return MergedXdf()

    return (offer("xdf", XdfSettings, xdf),)
