"""my_part keeps the contract of its role; add what else it promises."""

import numpy as np
import pytest
from my_module import MyPart, MyPartSettings

from labcrane import FloatArray, SignalMonitor
from labcrane.core import SignalChannel, SignalStream
from labcrane.testing import SignalMonitorContract

STREAM = SignalStream("Oil", "Temperature", 10.0, (SignalChannel("tank", "°C"),))


class TestMyPart(SignalMonitorContract):
    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return MyPart(MyPartSettings())

    @pytest.fixture
    def stream(self) -> SignalStream:
        return STREAM

    @pytest.fixture
    def clean(self) -> FloatArray:
        return 40.0 + np.random.default_rng(1).standard_normal((200, 1))


def test_a_channel_is_told_when_it_has_been_beyond_for_long_enough() -> None:
    monitor = MyPart(MyPartSettings(largest=50.0, patience_s=1.0))
    monitor.begin(STREAM)
    hot = np.full((9, 1), 60.0)
    assert not monitor.look(np.arange(9) / 10.0, hot)
    (fault,) = monitor.look(np.array([0.9]), hot[:1])
    assert (fault.channel, fault.kind) == ("tank", "too large")
