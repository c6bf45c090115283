"""my_part keeps the contract of its role; add what else it promises."""

import numpy as np
import pytest
from my_module import MyPart, MyPartSettings

from labcrane import Dynamics
from labcrane.testing import DynamicsContract, ch8, make_run, opened


class TestMyPart(DynamicsContract):
    @pytest.fixture
    def dynamics(self) -> Dynamics:
        return MyPart(MyPartSettings(), ch8())


def test_after_one_lag_a_joint_has_63_percent_of_its_speed() -> None:
    machine = ch8()
    dynamics = MyPart(MyPartSettings(lag_s=0.2), machine)
    run = make_run(machine, state=dynamics.signals)
    with opened(dynamics, run):
        for _ in range(200):
            state = dynamics.step(np.array([0.1, 0.0, 0.0, 0.0]), 0.001)
        speed = state[run.state.index("joint.velocity.slew")]
        np.testing.assert_allclose(speed, 0.1 * (1.0 - np.exp(-1.0)), rtol=1e-9)
