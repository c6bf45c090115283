"""Settings of the joysticks."""

from pydantic import Field

from labcrane import Settings


class JoystickSettings(Settings):
    """Settings of :class:`~labcrane_joystick.dual_joystick.DualJoystick`."""

    stick: str = Field(default="044f:b10a", pattern="^[0-9a-f]{4}:[0-9a-f]{4}$")
    """USB vendor and product of both sticks, four hexadecimal digits each; a Thrustmaster
    T.16000M unless said otherwise."""
