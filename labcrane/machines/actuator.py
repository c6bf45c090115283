"""Actuator model between commanded and joint speed: dead time, lag and a rate limit."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

from pydantic import (
    GetJsonSchemaHandler,
    NonNegativeFloat,
    PositiveFloat,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from labcrane.errors import suggestion
from labcrane.files.complaints import written
from labcrane.files.model import AtMost, StrictModel, Usual


class ActuatorSettings(StrictModel):
    """How a drive follows its command: written out, or a name in :data:`ACTUATOR_PRESETS`."""

    dead_time_s: Annotated[NonNegativeFloat, AtMost(60), Usual(0.001, 5.0)] = 0.0
    """Time before a command has any effect, in seconds; rounded to whole ticks."""

    lag_s: Annotated[NonNegativeFloat, AtMost(60), Usual(0.001, 5.0)] = 0.0
    """Time constant of the first-order lag, in seconds."""

    rate_limit: Annotated[PositiveFloat | None, Usual(0.1, 500.0)] = None
    """Largest change of speed, as a fraction of full joint speed per second; none by default."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Say that a name will do."""
        written = super().__get_pydantic_json_schema__(core, handler)
        return {"anyOf": [{"enum": list(ACTUATOR_PRESETS)}, written]}

    @model_validator(mode="before")
    @classmethod
    def _may_be_a_name(cls, value: Any) -> Any:
        if isinstance(value, Mapping | ActuatorSettings):
            return value
        if isinstance(value, str) and value in ACTUATOR_PRESETS:
            return ACTUATOR_PRESETS[value].model_dump()
        if isinstance(value, str):
            message = f"no actuator is called {value!r}; {suggestion(value, ACTUATOR_PRESETS)}"
            raise ValueError(message)  # noqa: TRY004 - pydantic reports no TypeError
        raise ValueError(
            f"{written(value)} is not an actuator; write a name ({', '.join(ACTUATOR_PRESETS)}) or "
            f"a mapping of {', '.join(cls.model_fields)}"
        )


ACTUATOR_PRESETS: dict[str, ActuatorSettings] = {
    "ideal": ActuatorSettings(),
    "electric": ActuatorSettings(dead_time_s=0.01, lag_s=0.03),
    "hydraulic": ActuatorSettings(dead_time_s=0.06, lag_s=0.15, rate_limit=4.0),
    "sluggish": ActuatorSettings(dead_time_s=0.2, lag_s=0.4, rate_limit=2.0),
}
"""Named delays. The figures are ours: orders of magnitude of such drives, not measurements."""


class Actuator:
    """Dead time, then lag, then rate limit, for each joint.

    A command holds over its tick, and so does the speed that comes of it. The lag is discretised
    exactly for that: at the end of a tick the speed has moved towards the delayed command by
    ``1 - exp(-dt / lag)`` of the distance, which is the step response at that moment.

    Parameters
    ----------
    settings
        The delays.
    speeds
        Full joint speeds in rad/s, which the rate limit is a fraction of.
    dt
        Length of a tick, in seconds.
    """

    def __init__(self, settings: ActuatorSettings, speeds: Sequence[float], dt: float) -> None:
        self.ideal = settings == ACTUATOR_PRESETS["ideal"]
        self._still = (0.0,) * len(speeds)
        self._delay = round(settings.dead_time_s / dt)
        self._share = 1.0 - math.exp(-dt / settings.lag_s) if settings.lag_s else 1.0
        limit = math.inf if settings.rate_limit is None else settings.rate_limit
        self._most = tuple(limit * speed * dt for speed in speeds)
        self.reset()

    def reset(self) -> None:
        """Forget every command: the joints are at rest."""
        self._speeds = list(self._still)
        self._waiting = deque([self._still] * self._delay)

    @property
    def delay(self) -> int:
        """Ticks before a command has any effect."""
        return self._delay

    @property
    def constants(self) -> tuple[float, ...]:
        """Whether it is ideal, the lag's share of a tick, each joint's largest change in rad/s."""
        return (float(self.ideal), self._share, *self._most)

    def numbers(self) -> list[float]:
        """Return the state for a compiled kernel: speeds, then delayed commands, in rad/s."""
        return [*self._speeds, *(speed for command in self._waiting for speed in command)]

    def go_on(self, numbers: Sequence[float]) -> None:
        """Take over the state of a compiled kernel: :attr:`numbers`, in rad/s."""
        joints = len(self._speeds)
        self._speeds = list(numbers[:joints])
        rows = range(joints, joints * (1 + self._delay), joints)
        self._waiting = deque(tuple(numbers[at : at + joints]) for at in rows)

    def follow(self, command: Sequence[float]) -> Sequence[float]:
        """Return the joint speeds in rad/s that a tick with this command leads to."""
        if self.ideal:
            return command
        self._waiting.append(tuple(command))
        speeds = self._speeds
        for joint, goal in enumerate(self._waiting.popleft()):
            change = self._share * (goal - speeds[joint])
            most = self._most[joint]
            speeds[joint] += most if change > most else -most if change < -most else change
        return tuple(speeds)
