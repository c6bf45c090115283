"""Settings of the aiming task."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import (
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
    model_validator,
)

from labcrane import Machine, Settings
from labcrane.core import AtMost, ButtonName, Names, Unit, was_run

EVENTS = (
    "targets.shown", "target.entered", "command.onset", "movement.onset", "movement.offset",
    "tap.ignored",
)  # fmt: skip
"""Events of a movement other than its beginning and end."""


class AimingSettings(Settings):
    """Settings of :class:`~labcrane_aiming.aiming.Aiming`.

    The published study gives neither the geometry nor the rules; the defaults are a proposal that
    both bundled machines can reach (``docs/decisions/0004-aiming-geometry.md``).
    """

    distances: Annotated[tuple[PositiveFloat, ...], Field(min_length=1), Unit("m")] = (
        2.0,
        3.0,
        4.0,
        6.0,
    )
    """Distances between the two circles' centres, in metres. Each is used in both mirror images."""

    width: Annotated[PositiveFloat, Unit("m")] = 0.5
    """Diameter of a circle, in metres."""

    movements: Annotated[PositiveInt, AtMost(1000)] = 4
    """Counted movements per pair of circles."""

    centre: Annotated[tuple[float, float, float], Unit("m")] = (5.5, 0.0, 0.8)
    """Middle between the two circles in the machine's base frame: x, y, z in metres."""

    diagonal_deg: float = Field(default=45.0, ge=0.0, le=90.0)
    """Angle between the line through the circles and the x axis, in degrees."""

    end: Literal["rest_inside", "rest_anywhere", "trigger"] = "rest_inside"
    """What ends a movement: the tip at rest inside the circle, the tip at rest once most of the
    way is done, or the trigger. With ``rest_inside`` an error cannot exceed the radius. A press
    before anything has moved ends nothing, unless the tip is in the circle already."""

    trigger: ButtonName = "right.trigger"
    """The button that ends a movement when ``end`` is ``trigger``."""

    rest_speed: Annotated[PositiveFloat, Unit("m/s")] = 0.02
    """Tip speed below which the tip is at rest, in metres per second."""

    rest_s: NonNegativeFloat = 0.2
    """How long the tip must be at rest, in seconds."""

    rest_after: float = Field(default=0.5, gt=0.0, le=1.0)
    """Fraction of the way after which a rest ends a movement, when ``end`` is ``rest_anywhere``."""

    onset_speed: Annotated[PositiveFloat, Unit("m/s")] = 0.02
    """Tip speed above which a movement has begun, in metres per second. Set it just above the speed
    that the noise of the machine's sensors shows for a tip at rest."""

    onset_hold_s: NonNegativeFloat = 0.1
    """Time for which the tip must stay above the onset speed, in seconds. The event
    ``movement.onset`` is sent after this time, with the timestamp of the onset."""

    limit_s: PositiveFloat = 30.0
    """Longest a movement may take, in seconds; then it ends as a time-out."""

    def provides(self, machine: Machine) -> Names:
        return {"object": ("target", "other"), "event": EVENTS}

    def needs(self, machine: Machine) -> Names:
        return {"button": [self.trigger]} if self.end == "trigger" else {}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        needed, found = shortest_s(self, machine), {}
        if self.limit_s < needed:
            found["limit_s"] = (
                f"is {self.limit_s:g} s, and at full speed the farthest movement takes more than "
                f"{_about(needed)} s"
            )
        for key, held_s, never in (
            ("onset_hold_s", self.onset_hold_s, "no movement has an onset or a reaction time"),
            ("rest_s", self.rest_s, "no rest ends a movement"),
        ):
            if held_s >= self.limit_s:
                found[key] = f"is {held_s:g} s, and a movement may take {self.limit_s:g} s: {never}"
        fastest = fastest_m_s(machine)
        for key, speed in (("onset_speed", self.onset_speed), ("rest_speed", self.rest_speed)):
            if speed >= fastest:
                found[key] = f"is {speed:g} m/s, and the tip never reaches {_about(fastest)} m/s"
        return found

    @model_validator(mode="before")
    @classmethod
    def _former(cls, written: object, info: ValidationInfo) -> object:
        # A record may say which share of the peak speed an onset had to have, by a former rule.
        if was_run(info) and isinstance(written, Mapping):
            return {key: value for key, value in written.items() if key != "onset_share"}
        return written

    @field_validator("distances")
    @classmethod
    def _each_is_one(cls, distances: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        twice = [each for each in distances if distances.count(each) > 1]
        if twice and not was_run(info):
            raise ValueError(
                f"{twice[0]:g} m is listed twice; write each distance once, and decimals with a "
                "point: [1.5, 2.5, 4]"
            )
        return distances

    @field_validator("width")
    @classmethod
    def _circles_are_apart(cls, width: float, info: ValidationInfo) -> float:
        shortest = min(info.data.get("distances", ()), default=math.inf)
        if width >= shortest and not was_run(info):
            raise ValueError(
                f"a circle {width:g} m wide holds the middle of its partner {shortest:g} m away; "
                f"write less than {shortest:g}"
            )
        return width


def shortest_s(settings: AimingSettings, machine: Machine) -> float:
    """Return a time in s that the farthest movement and the rest behind it take at least.

    No point of the machine turns about a joint faster than the joint does, at the length of all
    that is beyond it; so the tip is never faster than the sum over the joints.
    """
    way = max(settings.distances) - settings.width / 2
    rest = settings.rest_s if settings.end != "trigger" else 0.0
    return way / fastest_m_s(machine) + rest


def fastest_m_s(machine: Machine) -> float:
    """Return a speed in m/s that the tip never reaches, all joints at full speed."""
    lengths = [math.hypot(joint.a, joint.d) for joint in machine.joints]
    beyond = [sum(lengths[at:]) for at in range(len(lengths))]
    return float(sum(speed * arm for speed, arm in zip(machine.speeds, beyond, strict=True)))


def _about(number: float) -> str:
    """Return a number by its first two digits, as people write it: 100, and not 1e+02."""
    return f"{float(f'{number:.2g}'):g}"
