"""my_part keeps the contract of its role; add what else it promises."""

import numpy as np
import pytest
from my_module import MyPart, MyPartSettings

from labcrane import InputDevice
from labcrane.testing import InputContract, ch8, make_frame, make_run, opened


class TestMyPart(InputContract):
    @pytest.fixture
    def device(self) -> InputDevice:
        return MyPart(MyPartSettings())


def test_the_wave_comes_back_after_its_period() -> None:
    device = MyPart(MyPartSettings(period_s=2.0))
    run = make_run(ch8(), axes=device.signals)
    with opened(device, run):
        first, later = make_frame(run, 100), make_frame(run, 100 + 480)
        before = device.read(first.tick, first).copy()
        np.testing.assert_allclose(device.read(later.tick, later), before, atol=1e-12)
