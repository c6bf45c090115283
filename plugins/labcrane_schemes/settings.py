"""Settings of the schemes."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat

from labcrane import Machine, Settings
from labcrane.core import (
    AxisName,
    ButtonName,
    Covers,
    JointName,
    Names,
    Once,
    Reference,
    Unit,
    Usual,
)
from labcrane.machines import directions

DIRECTIONS = {"base": ("x", "y", "z"), "arm": ("radial", "tangential", "vertical")}
"""Directions in which a stick moves the tip, for each ``frame``."""


Direction = Annotated[str, Reference("direction of the frame", own=True)]
"""A direction in which the tip is moved."""


LARGEST_DEAD_ZONE = 0.5

FEWER_AXES = (
    "with three, use: end_effector moves the tip along three directions; with fewer, take a "
    "machine with as many joints (machine: a YAML file, or urdf: with joints:)"
)
"""What a study can do whose input cannot turn every joint."""


class HandlingSettings(Settings):
    """Settings of every scheme: shaping of the sticks, and soft stops at joint limits."""

    dead_zone: float = Field(default=0.05, ge=0.0, lt=1.0)
    """Deflection below which nothing moves, as a proportion of full deflection. The rest of the
    range is rescaled, so that motion begins without a jump."""

    expo: float = Field(default=0.0, ge=0.0, le=1.0)
    """Weight of the cubic term in ``(1 - expo) x + expo x³``; a larger value gives finer control
    around the centre."""

    soft_stop_deg: NonNegativeFloat = 5.0
    """Distance from a joint limit, in degrees, over which the joint is slowed to a stop."""

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        found = {}
        if self.dead_zone > LARGEST_DEAD_ZONE:
            found["dead_zone"] = (
                f"is {self.dead_zone:g}, so that a stick has no effect over most of its range"
            )
        widths = [highest - lowest for lowest, highest in (j.range_deg for j in machine.joints)]
        if 2 * self.soft_stop_deg >= min(widths):
            found["soft_stop_deg"] = (
                f"is {self.soft_stop_deg:g} degrees at either end, and a joint turns by "
                f"{min(widths):g} in all, so that it is never at full speed"
            )
        return found


class JointVelocitySettings(HandlingSettings):
    """Each axis turns one joint."""

    map: Annotated[dict[JointName, AxisName], Covers("joint", otherwise=FEWER_AXES), Once()]
    """Which axis turns which joint, one for every joint of the machine. A positive slew is to the
    left and a positive pitch down, so that with two sticks ``slew: -left.x`` turns right when the
    left stick is pushed to the right, and ``shoulder: -right.y`` lifts when the right one is
    pulled."""

    speed: float = Field(default=1.0, gt=0.0, le=1.0)
    """Joint speed at full deflection, as a fraction of the machine's joint speeds."""

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        return {**super().doubts(machine), **directions.doubted_joints(machine, self.map)}

    def directions(self, machine: Machine) -> Sequence[str]:
        return directions.of_joints(machine, self.map)


class EndEffectorSettings(HandlingSettings):
    """Each axis moves the tip along one direction.

    Of all ways to move it, the joints take that with the smallest speeds: the tip's pitch drifts,
    and the others take over from a joint at its limit. Where the joints cannot move the tip as
    asked for, near a limit or a singularity, it goes as nearly that way as they can, and slower.
    """

    map: Annotated[dict[Direction, AxisName], Covers("direction of the frame", own=True), Once()]
    """Which axis moves the tip along which direction: x, y and z of the base frame, or radial,
    tangential and vertical as seen from the slew axis (see ``frame``). They are positive away from
    the operator, to the left and up, so that with two sticks ``{x: -left.y, y: -left.x,
    z: right.y}`` moves the tip where a stick is pushed, and lifts it when the right one is
    pulled."""

    frame: Literal["base", "arm"] = "base"
    """Whether the directions stay with the base or turn with the arm."""

    speed_m_s: Annotated[PositiveFloat | None, Usual(0.02, 5.0)] = None
    """Tip speed at full deflection of one axis, in m/s. By default what the machine's joints
    allow at the study's targets (the median over targets and directions: along the arm, across it
    and up), so that schemes are comparable."""

    damping: Annotated[float, Unit("m")] = Field(default=0.2, gt=0.0, le=1.0)
    """Largest damping of the least squares, in metres, reached at a singularity."""

    threshold_m: PositiveFloat = 0.5
    """Smallest singular value of the planar Jacobian, in metres, below which damping begins."""

    def provides(self, machine: Machine) -> Names:
        return {"direction of the frame": DIRECTIONS[self.frame]}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        return {**super().doubts(machine), **directions.doubted_ways(self.map)}

    def directions(self, machine: Machine) -> Sequence[str]:
        return directions.of_the_tip(self.map)


class SwitchableSettings(Settings):
    """Two schemes, and a button that changes between them during a trial."""

    button: ButtonName
    """The button: pressed beyond half, it changes the scheme."""

    joint_velocity: JointVelocitySettings
    """One scheme; ``scheme.active`` is 0."""

    end_effector: EndEffectorSettings
    """The other scheme; ``scheme.active`` is 1."""

    start: Literal["joint_velocity", "end_effector"] = "joint_velocity"
    """The scheme in which every trial begins."""

    ramp_s: Annotated[NonNegativeFloat, Usual(0.01, 5.0)] = 0.5
    """Time over which a change goes from one scheme's command to the other's, in seconds."""

    def provides(self, machine: Machine) -> Names:
        return {"scheme": ("joint_velocity", "end_effector")}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        either = {"joint_velocity": self.joint_velocity, "end_effector": self.end_effector}
        return {
            f"{name}.{key}": text
            for name, settings in either.items()
            for key, text in settings.doubts(machine).items()
        }

    def directions(self, machine: Machine) -> Sequence[str]:
        either = {"joint_velocity": self.joint_velocity, "end_effector": self.end_effector}
        return tuple(
            f"with {name}, {text}"
            for name, settings in either.items()
            for text in settings.directions(machine)
        )
