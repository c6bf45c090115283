"""my_part keeps the contract of its role; add what else it promises."""

import numpy as np
import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Controller
from labcrane.testing import ControllerContract, ch8, crane_at, make_run, opened


class TestMyPart(ControllerContract):
    @pytest.fixture
    def controller(self) -> Controller:
        return MyPart(MyPartSettings(), ch8())


def test_a_full_push_turns_a_joint_at_its_share_of_speed() -> None:
    machine = ch8()
    controller = MyPart(MyPartSettings(speed=0.25), machine)
    run = make_run(machine, command=controller.signals)
    with opened(controller, run):
        axes = np.zeros(run.axes.size)
        axes[run.axes.index("left.x")] = 1.0
        command = controller.command(axes, crane_at(machine, machine.rest))
        np.testing.assert_allclose(command, [0.25 * machine.speeds[0], 0.0, 0.0, 0.0])
