"""Settings of actuators: dead time, lag and a rate limit between commanded and joint speed."""

from collections.abc import Mapping
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
