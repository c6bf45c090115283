"""Every bundled kernel beside its component, tick by tick."""

from itertools import product

import pytest
from cranes import build
from needs import need, needs

from labcrane import Controller
from labcrane.core import CraneSettings
from labcrane.core.roles import Component
from labcrane.testing import KernelContract, ch8
from labcrane_aiming.aiming import Aiming
from labcrane_aiming.settings import AimingSettings
from labcrane_bullet.kinematic_crane import KinematicCrane
from labcrane_operator.operator import SimulatedOperator
from labcrane_operator.settings import OperatorSettings
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_schemes.settings import EndEffectorSettings, JointVelocitySettings, SwitchableSettings
from labcrane_schemes.switchable import Switchable

pytestmark = [pytest.mark.long, needs("numba")]

JOINTS = JointVelocitySettings(
    map={"slew": "left.x", "elbow": "left.y", "wrist": "right.x", "shoulder": "-right.y"},
    soft_stop_deg=40.0,
    expo=0.3,
)
TIP = EndEffectorSettings(map={"x": "left.y", "y": "-left.x", "z": "right.y"}, soft_stop_deg=40.0)


class TestSchemes(KernelContract):
    @pytest.fixture(params=["joint_velocity", "end_effector", "switchable"])
    def component(self, request: pytest.FixtureRequest) -> Controller:
        match request.param:
            case "joint_velocity":
                return JointVelocity(JOINTS, ch8())
            case "end_effector":
                return EndEffector(TIP, ch8())
        both = SwitchableSettings(button="right.trigger", joint_velocity=JOINTS, end_effector=TIP)
        return Switchable(both, ch8())


class TestCranes(KernelContract):
    @pytest.fixture(params=["ideal", "electric", "hydraulic", "sluggish"])
    def component(self, request: pytest.FixtureRequest) -> Component:
        return KinematicCrane(CraneSettings.model_validate({"actuator": request.param}), ch8())


ENGINES = ("bullet_crane", "mujoco_crane")


class TestEngines(KernelContract):
    @pytest.fixture(params=list(product(ENGINES, [{"lag_s": 0.5}, "hydraulic", "ideal"])), ids=str)
    def component(self, request: pytest.FixtureRequest) -> Component:
        engine, actuator = request.param
        need({"bullet_crane": "pybullet", "mujoco_crane": "mujoco"}[engine])
        # Commands of this contract jump: what a drive has not the torque for the engine makes.
        return build(engine, ch8(), actuator)


class TestTask(KernelContract):
    @pytest.fixture(params=["rest_inside", "rest_anywhere", "trigger"])
    def component(self, request: pytest.FixtureRequest) -> Component:
        return Aiming(AimingSettings(end=request.param), ch8())


class TestOperator(KernelContract):
    @pytest.fixture
    def component(self) -> Component:
        return SimulatedOperator(OperatorSettings())


def test_a_kernel_that_differs_by_a_bit_breaks_the_contract() -> None:
    class Off(KinematicCrane):
        def step(self, command, dt):
            return super().step(command * (1.0 + 2.3e-16), dt)

    with pytest.raises(AssertionError, match=r"in tick \d+ the kernel made"):
        KernelContract().test_kernel_makes_its_components_numbers_tick_by_tick(
            Off(CraneSettings(), ch8())
        )
