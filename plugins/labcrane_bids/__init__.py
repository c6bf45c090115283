"""Export of recordings as a BIDS 1.11 data set: motion, events, eye tracking."""

from collections.abc import Sequence

from labcrane import Machine, Offer, hookimpl, offer
from labcrane.analysis import Exporter
from labcrane_bids.settings import BidsSettings

labcrane_api = 1


@hookimpl
def labcrane_exporters() -> Sequence[Offer[Exporter]]:
    def bids(settings: BidsSettings, machine: Machine) -> Exporter:
        from labcrane_bids.bids import Bids

        return Bids(settings, machine)

    return (offer("bids", BidsSettings, bids),)
