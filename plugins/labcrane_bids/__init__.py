"""Export of recordings as a BIDS 1.11 data set: motion, events, eye tracking."""

from labcrane import Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_bids.settings import BidsSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> list[Offer[Exporter]]:
    return [offer("bids", BidsSettings, "labcrane_bids.bids:Bids")]
