"""Settings of the joysticks."""

from pydantic import Field

from labcrane import Machine, Settings
from labcrane.core import Names

SIDES = ("left", "right")
AXES = ("x", "y", "twist", "slider")
"""The axes of a T.16000M, in SDL's order."""

PARTS = (*AXES, "trigger", "connected")


class JoystickSettings(Settings):
    """Settings of :class:`~labcrane_joystick.dual_joystick.DualJoystick`."""

    stick: str = Field(default="044f:b10a", pattern="^[0-9a-f]{4}:[0-9a-f]{4}$")
    """USB vendor and product of both sticks, four hexadecimal digits each; a Thrustmaster
    T.16000M unless said otherwise."""

    def provides(self, machine: Machine) -> Names:
        return {
            "axis": [f"{side}.{part}" for side in SIDES for part in PARTS],
            "button": [f"{side}.trigger" for side in SIDES],
        }
