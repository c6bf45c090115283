"""my_part keeps the contract of its role; add what else it promises."""

import numpy as np
import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Estimate, FloatArray
from labcrane.core import EstimateSettings, SignalChannel, SignalStream
from labcrane.testing import EstimateContract

STREAM = SignalStream("Grip", "Force", 100.0, (SignalChannel("grip", "N"),))
SETTINGS = MyPartSettings(stream="grip", fallback={"mean": 0.0})


class TestMyPart(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return SETTINGS

    @pytest.fixture
    def estimate(self) -> Estimate:
        return MyPart(SETTINGS)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return STREAM

    @pytest.fixture
    def clean(self) -> FloatArray:
        return 20.0 + np.random.default_rng(1).standard_normal((300, 1))


def test_a_step_is_in_the_mean_after_the_window() -> None:
    estimate = MyPart(SETTINGS)
    estimate.begin(STREAM)
    assert estimate.update(np.arange(100) / 100.0, np.zeros((100, 1))) is None
    found = estimate.update(1.0 + np.arange(200) / 100.0, np.ones((200, 1)))
    assert found is not None
    assert found.values == (1.0,)
