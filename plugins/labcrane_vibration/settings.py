"""Settings of the vibration."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from labcrane import Machine, Settings
from labcrane.core import ByEstimate, Names, SignalName, Unit, Within, WrongKey

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]

FASTEST_HZ = 10.0
"""Pulses per second above which people cannot count them, and frames at 60 Hz no longer hold
them."""

MOTORS = 2
"""Motors of a controller: a slow heavy one, and a fast light one."""

SAME = 1e-6
"""Difference of a sine or cosine that is rounding."""


class VibrationSettings(Settings):
    """How the vibration follows the movement, and what it is given to.

    With the defaults it tells what the tone of ``sonification`` tells without ``pan``: the
    distance, and by its silence that the tip is inside the target.
    """

    driver: Literal["serial", "udp", "rumble"] = "serial"
    """Tactors on a serial line, tactors by UDP, or the two motors of a game controller."""

    port: Annotated[str, Field(min_length=1)] | None = None
    """Serial port of the tactors: ``/dev/ttyACM0``, ``COM3``."""

    baud: PositiveInt = 115_200
    """Baud rate of the serial port."""

    address: Annotated[str, Field(pattern=r"^[^:]+:\d{1,5}$")] | None = None
    """Address of the tactors for UDP: ``192.168.0.20:9000``."""

    stick: PositiveInt = 1
    """Number of the controller that rumbles, from 1, as SDL counts them; ``labcrane doctor`` says
    its name."""

    tactors: Annotated[dict[str, Degrees | None], Field(min_length=1, max_length=8)] = Field(
        default={"seat": None}
    )
    """Tactors by name, in the order of their outputs, each with the direction that it stands for,
    in degrees: 0 outward from the foot of the machine along x, 90 to the left. A tactor with a
    direction vibrates the more, the more the target lies there; null: by distance alone."""

    far: Annotated[PositiveFloat, Unit("m")] = 4.0
    """Distance between tip and target, in metres, beyond which the vibration no longer changes."""

    amplitude: tuple[Share, Share] = (0.3, 0.9)
    """Amplitude far away and at the target, 0 to 1. Swap the values to reverse the polarity."""

    intensity: Share | ByEstimate = 1.0
    """Factor of ``amplitude``, 0 to 1. Or one that follows an estimate."""

    pulse_hz: tuple[PositiveFloat, PositiveFloat] | None = (1.0, 8.0)
    """Pulses per second far away and at the target; each is half on and half off. Null: without
    pulses."""

    aside: Annotated[PositiveFloat, Unit("m")] = 2.0
    """Horizontal distance, in metres, from which on a tactor of the opposite direction is at rest;
    at a smaller one it still vibrates a little."""

    silent_after_s: NonNegativeFloat | None = 0.3
    """Seconds inside the target after which the vibration stops; null lets it go on."""

    stimulus: SignalName | None = None
    """Stimulus of a secondary task, such as ``drt.stimulus``: all tactors vibrate with the
    amplitude at the target while it is on, and do not follow the movement."""

    at_most: Share = 1.0
    """Largest amplitude that a participant may be given; a larger ``amplitude`` is refused."""

    minutes: PositiveFloat = 30.0
    """Minutes of vibration that a participant may be given in a session; then the feedback fails,
    and ``feedback_lost`` decides."""

    def reveals(self) -> tuple[str | Within, ...]:
        if not any(self.amplitude) or self.stimulus:
            return ()
        told: list[str | Within] = []
        if not self._is_constant:
            told.append(Within("how far the tip is from the target", self.far))
        told += self._directions
        if self.silent_after_s is not None:
            told.append("whether the tip is inside the target")
        return tuple(told)

    def provides(self, machine: Machine) -> Names:
        own = {"serial": self.port, "udp": self.address, "rumble": f"controller {self.stick}"}
        return {"object": (), "port": (str(own[self.driver]),)}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        found = {}
        if not any(self.amplitude):
            found["amplitude"] = "is 0 at every distance: nothing is felt"
        elif self._is_constant and not self._directions and not self.stimulus:
            found["amplitude"] = (
                f"is {self.amplitude[0]:g} at every distance, and pulse_hz does not change, so "
                "that nothing is felt of it"
            )
        if self.pulse_hz and max(self.pulse_hz) > FASTEST_HZ:
            found["pulse_hz"] = (
                f"is up to {max(self.pulse_hz):g} Hz, which is felt as one vibration; at most "
                f"{FASTEST_HZ:g} Hz is felt as pulses"
            )
        if len(self.tactors) == 1 and None not in self.tactors.values():
            found["tactors"] = (
                "is one tactor with a direction, so that its amplitude mixes distance and "
                "direction; write null for its direction"
            )
        return found

    @property
    def _directions(self) -> list[str]:
        """What tactors of several directions tell."""
        told = []
        angles = [None if a is None else math.radians(a) for a in self.tactors.values()]
        for fact, part in (
            ("on which side the target is", math.sin),
            ("whether the target is ahead or behind", math.cos),
        ):
            parts = [0.0 if angle is None else part(angle) for angle in angles]
            if max(parts) - min(parts) > SAME:
                told.append(fact)
        return told

    @property
    def _is_constant(self) -> bool:
        slow, fast = self.pulse_hz or (0.0, 0.0)
        return self.amplitude[0] == self.amplitude[1] and slow == fast

    @model_validator(mode="after")
    def _has_a_device(self) -> "VibrationSettings":
        for driver, key in (("serial", "port"), ("udp", "address")):
            if self.driver == driver and getattr(self, key) is None:
                example = {"port": "/dev/ttyACM0", "address": "192.168.0.20:9000"}[key]
                raise WrongKey(f"driver: {driver} needs {key}: write {key}: {example}", at=(key,))
        if self.driver == "rumble" and len(self.tactors) > MOTORS:
            raise WrongKey(
                f"tactors are {len(self.tactors)}, and a controller has {MOTORS} motors; name "
                f"{MOTORS} at most",
                at=("tactors",),
            )
        return self

    @model_validator(mode="after")
    def _is_within_its_limit(self) -> "VibrationSettings":
        if max(self.amplitude) > self.at_most:
            raise WrongKey(
                f"amplitude goes up to {max(self.amplitude):g}, and at_most allows "
                f"{self.at_most:g}; lower the amplitude",
                at=("amplitude",),
            )
        return self
