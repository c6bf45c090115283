"""Export of sessions as XDF: all streams in one file, on one clock."""

from labcrane import Offer, Settings, hookimpl, offer
from labcrane.analysis import Exporter

labcrane_api = 1


class XdfSettings(Settings):
    """Settings of :class:`~labcrane_xdf.merged.MergedXdf`; there are none."""


@hookimpl
def labcrane_exporters() -> list[Offer[Exporter]]:
    return [offer("xdf", XdfSettings, "labcrane_xdf.merged:MergedXdf")]
