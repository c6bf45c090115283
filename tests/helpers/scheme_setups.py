"""Schemes as protocols write them, and hands that push."""

import numpy as np

from labcrane import Controller, FloatArray, Machine
from labcrane.machines import load_machine
from labcrane.testing import (
    ch8,
    make_run,
    make_trial,
)
from labcrane_schemes.settings import (
    EndEffectorSettings,
    JointVelocitySettings,
    SwitchableSettings,
)

JOINTS = {"slew": "left.x", "elbow": "left.y", "wrist": "right.x", "shoulder": "-right.y"}
BASE = {"x": "left.y", "y": "-left.x", "z": "right.y"}
ARM = {"radial": "left.y", "tangential": "-left.x", "vertical": "right.y"}
STICKS = ("left.x", "left.y", "left.trigger", "right.x", "right.y", "right.trigger")
MACHINES = {"ch8": ch8(), "ch8_cranelike": load_machine("ch8_cranelike")}
LOW = {  # tip over the targets of the aiming task, well inside every limit
    "ch8": np.radians([0.0, 10.0, 25.0, 45.0]),
    "ch8_cranelike": np.radians([0.0, 30.0, 10.0, 30.0]),
}


def joint_velocity(**changes: object) -> JointVelocitySettings:
    return JointVelocitySettings.model_validate({"map": JOINTS} | changes)


def end_effector(**changes: object) -> EndEffectorSettings:
    return EndEffectorSettings.model_validate({"map": BASE, "speed_m_s": 0.5} | changes)


def switchable(**changes: object) -> SwitchableSettings:
    return SwitchableSettings.model_validate(
        {
            "button": "right.trigger",
            "joint_velocity": {"map": JOINTS},
            "end_effector": {"map": BASE, "speed_m_s": 0.5},
        }
        | changes
    )


def ready(scheme: Controller, machine: Machine) -> Controller:
    scheme.open(make_run(machine, command=scheme.signals))
    scheme.begin_trial(make_trial())
    return scheme


def push(**axes: float) -> FloatArray:
    """Return axes from names with an underscore for the dot."""
    return np.array([axes.get(name.replace(".", "_"), 0.0) for name in STICKS])
