"""Settings of the arm and its valves."""

from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Field, NonNegativeFloat, PositiveFloat, ValidationInfo, model_validator

from labcrane import Machine, ProtocolError, Settings
from labcrane.core import (
    AxisName,
    JointName,
    Names,
    Once,
    StudyPath,
    Usual,
    read_yaml,
    was_run,
)
from labcrane.machines import directions


class ValveSettings(Settings):
    """The operator's axes go to the valves unchanged."""

    map: Annotated[dict[JointName, AxisName], Once()] = Field(default_factory=dict)
    """Axis that opens each joint's valve. A joint that is not listed has the axis
    ``valve.<joint>``, which a control panel provides."""

    model: StudyPath | None = None
    """The arm's Dynamic Model Description, for simulated operators: a practised hand knows how
    far to push for a speed. Without one they take speed for proportional to the signal."""

    def needs(self, machine: Machine) -> Names:
        return {"axis": [f"valve.{name}" for name in machine.names if name not in self.map]}

    def axes(self, machine: Machine) -> Mapping[str, str]:
        """Return the axis of each joint, in the machine's order."""
        return {name: self.map.get(name, f"{directions.VALVE}{name}") for name in machine.names}

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        return directions.doubted_joints(machine, self.axes(machine))

    def directions(self, machine: Machine) -> Sequence[str]:
        return directions.of_joints(machine, self.axes(machine))


class JawsSettings(Settings):
    """The pair of jaws at the end of the arm."""

    joint: JointName = "jaws"
    """The machine's joint whose angle is their opening. It must be the last and have length 0: the
    arm's tip is the point between the jaws."""

    length_m: PositiveFloat = 0.24
    """Distance from the hinge to the point between the jaws, in metres."""

    width_m: PositiveFloat = 0.12
    """Width of a jaw, in metres."""

    thickness_m: PositiveFloat = 0.03
    """Thickness of a jaw, in metres."""

    grip_n: PositiveFloat = 60.0
    """Force in newtons above which a grip forms, if both jaws press with more than this."""

    release_deg: PositiveFloat = 2.0
    """Angle in degrees by which the jaws must open to release a grip."""

    squeeze_n: Annotated[NonNegativeFloat, Usual(0.1, 10_000.0)] = 0.0
    """Additional force of each jaw on the held thing, in newtons per millimetre of further closing,
    up to the maximum of its drive. Opening releases the grip. With 0, a grip does not tighten."""


class OverloadSettings(Settings):
    """When a joint counts as overloaded."""

    limit: float = Field(default=0.98, gt=0.0, le=1.0)
    """Load at which an overload begins, as a fraction of the joint's effort."""

    release: float = Field(default=0.8, gt=0.0, le=1.0)
    """Load below which an overload may end."""

    hold_s: NonNegativeFloat = 0.2
    """Time in seconds for which the load must stay below ``release`` for an overload to end."""


class ProportionalValveSettings(Settings):
    """The valve of joints that the model does not describe."""

    dead_band: Annotated[float, Usual(0.5, 100.0)] = Field(ge=0.0, lt=250.0)
    """Signal up to which the joint does not move, in steps of 0.4 % of full flow."""

    dead_time_s: Annotated[NonNegativeFloat, Usual(0.001, 5.0)]
    """Time before a signal has any effect, in seconds."""

    lag_s: Annotated[NonNegativeFloat, Usual(0.001, 5.0)]
    """Time constant with which the valve opens, in seconds."""

    @property
    def numbers(self) -> tuple[float, float, float]:
        """Dead band in signals, dead time and lag in s."""
        return self.dead_band, self.dead_time_s, self.lag_s


class ArmSettings(Settings):
    """An arm that moves according to a Dynamic Model Description."""

    model: StudyPath
    """The model's YAML file, made with ``labcrane dmd fit``."""

    proportional: Annotated[tuple[JointName, ...], Once()] = ()
    """Joints that the model does not describe and whose speed is proportional to the signal beyond
    the dead band, up to the machine's joint speed. Every joint is either here or in the model."""

    proportional_valve: ProportionalValveSettings | None = None
    """Dead band, dead time and lag of these joints; by default the means of the model's joints."""

    scenes: tuple[StudyPath, ...] = ()
    """Scene files whose objects, figures and obstacles the arm can touch. The trial's condition
    ``scenario`` selects the scene."""

    jaws: JawsSettings | None = None
    """The jaws, if the arm has any."""

    overload: OverloadSettings = OverloadSettings()
    """Load at which an overload of a joint begins, and conditions for its end."""

    window_s: PositiveFloat = 0.05
    """Averaging time of contact forces and loads, in seconds."""

    @model_validator(mode="before")
    @classmethod
    def _former(cls, written: object, info: ValidationInfo) -> object:
        # Recordings without this key had no valve for these joints.
        if was_run(info) and isinstance(written, Mapping):
            none = {"dead_band": 0.0, "dead_time_s": 0.0, "lag_s": 0.0}
            return {"proportional_valve": none, **written}
        return written

    def provides(self, machine: Machine) -> Names:
        from labcrane.machines import load_scene  # noqa: PLC0415 - loads numpy

        things: set[str] = set()
        for at, path in enumerate(self.scenes):
            try:
                things |= {*load_scene(path).things}
            except ProtocolError as error:
                raise ProtocolError(str(error), at=("scenes", at)) from error
        return {
            "speed law": [*self._described(), *self.proportional],
            "scene": [str(path) for path in self.scenes],
            "object": [*sorted(things), *(("jaw_upper", "jaw_lower") if self.jaws else ())],
        }

    def _described(self) -> tuple[str, ...]:
        """Return the joints that the model describes."""
        try:
            written = read_yaml(self.model)
        except ProtocolError as error:
            raise ProtocolError(str(error), at=("model",)) from error
        described = written.get("segments") if isinstance(written, dict) else None
        if not isinstance(described, dict):
            raise ProtocolError(
                f"dynamics.model is {self.model.name!r}, which is not a model: it has no segments; "
                "make one with labcrane dmd fit",
                at=("model",),
            )
        return tuple(described)

    def doubts(self, machine: Machine) -> Mapping[str, str]:
        described = self._described()
        found = {}
        if both := [name for name in self.proportional if name in described]:
            said = f"has {', '.join(both)}, which {self.model.name} describes as well"
            found["proportional"] = said
        if self.overload.release > self.overload.limit:
            found["overload.release"] = (
                f"is {self.overload.release:g}, above the limit of {self.overload.limit:g}: an "
                "overload ends while it begins"
            )
        return found

    def check_jaws(self, machine: Machine) -> None:
        """Refuse jaws at another joint than the last.

        Raises
        ------
        ProtocolError
            The joint is not the last, or has a length.
        """
        last = machine.joints[-1]
        joint = self.jaws.joint if self.jaws else last.name
        if self.jaws and joint in machine.names and (last.name != joint or last.a):
            raise ProtocolError(
                f"the jaws' joint {joint!r} must be the machine's last and have length 0, but the "
                f"last is {last.name!r}, {last.a:g} m long",
                at=("jaws", "joint"),
            )

    def needs(self, machine: Machine) -> Names:
        self.check_jaws(machine)
        return {"joint": [self.jaws.joint] if self.jaws else [], "speed law": machine.names}
