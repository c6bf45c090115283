"""my_part keeps the contract of its role; add what else it promises."""

import pytest
from my_module import MyPart, MyPartSettings

from labcrane import SecondaryTask
from labcrane.testing import SecondaryTaskContract, ch8, make_frame, make_run, make_trial, opened


class TestMyPart(SecondaryTaskContract):
    @pytest.fixture
    def secondary(self) -> SecondaryTask:
        return MyPart(MyPartSettings())


def test_a_press_counts_for_its_period() -> None:
    secondary, run = MyPart(MyPartSettings(period_s=1.0)), make_run(ch8())
    with opened(secondary, run):
        secondary.begin_trial(make_trial())
        for number in range(round(1.5 * run.rate_hz)):
            frame = make_frame(run, number)
            frame.axes[run.axes.index("left.trigger")] = float(number < 5)
            secondary.evaluate(frame)
        assert secondary.measure() == {"share": 1.0}  # half a period is not counted
