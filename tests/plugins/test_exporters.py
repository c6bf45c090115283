"""Every bundled exporter keeps the contract of its role."""

import pytest

from labcrane.analysis import Exporter
from labcrane.testing import ExporterContract, ch8, discover


class TestExporters(ExporterContract):
    @pytest.fixture(params=["tables", "psychds", "matlab", "bids", "xdf", "zip"])
    def exporter(self, request: pytest.FixtureRequest) -> Exporter:
        offer = discover().find(Exporter, request.param)
        needed = {"license": "CC0-1.0"} if offer.name == "zip" else {}
        return offer.build(offer.settings(**needed), ch8())
