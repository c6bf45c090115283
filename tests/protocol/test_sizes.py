"""Sizes of numbers: what is a thousand times too large or too small is refused or asked about."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from labcrane.files.model import SPREAD, _shape, usual
from labcrane.files.units import unit_of
from labcrane.protocol.protocol import Protocol
from labcrane.protocol.questions import PLAUSIBLE
from labcrane.testing import discover

OWN_UNIT = "counts in the unit of what the study measures"
A_NUMBER_OF = "is the number by which something is called"
ITS_DOUBTS = "is asked about by the doubts of its settings, beside others"
SHARE = "is refused beyond its bounds; as small as you like is as good as 0"

ANY: dict[str, str] = {
    "StopRule.above": OWN_UNIT,
    "StopRule.below": OWN_UNIT,
    "QuestPlus.spreads": OWN_UNIT,
    "QuestPlus.until_sd": OWN_UNIT,
    "Track.at_least": OWN_UNIT,
    "Track.at_most": OWN_UNIT,
    "QuestionSettings.lowest": OWN_UNIT,
    "ForceSettings.largest": OWN_UNIT,
    "CanSettings.neutral": OWN_UNIT,
    "Block.condition": A_NUMBER_OF,
    "PageSettings.port": A_NUMBER_OF,
    "SonificationSettings.device": A_NUMBER_OF,
    "ViewSettings.screen": A_NUMBER_OF,
    "ViewSettings.screens": A_NUMBER_OF,
    "Criterion.successes": "is asked about where there are fewer trials",
    "Step.seconds": "is asked about by the questions about breaks",
    "LoadedCraneSettings.payload_kg": ITS_DOUBTS,
    "Assist.share": SHARE,
    "ByEstimate.to": SHARE,
    "ByEstimate.between": OWN_UNIT,
    "GazeRegionSettings.between_x": OWN_UNIT,
    "GazeRegionSettings.between_y": OWN_UNIT,
    "QuestPlus.guess": SHARE,
    "OperatorSettings.lapse_rate": SHARE,
    "ErrorSettings.over_grip": SHARE,
    "ErrorSettings.misses": SHARE,
    "ErrorSettings.false_reports": SHARE,
    "JointVelocitySettings.expo": SHARE,
    "EndEffectorSettings.expo": SHARE,
    "ViewSettings.shadow": "is refused beyond 8192, and 0 casts none",
}  # fmt: skip
"""Keys whose number may be of any size, or is judged beside others, and why."""


def inside(annotation: Any) -> Iterator[type[BaseModel]]:
    plain = get_origin(annotation) is None and isinstance(annotation, type)
    if plain and issubclass(annotation, BaseModel):
        yield annotation
    for each in get_args(annotation):
        yield from inside(each)


def models() -> list[type[BaseModel]]:
    found: dict[type[BaseModel], None] = {}

    def walk(model: type[BaseModel]) -> None:
        if model not in found:
            found[model] = None
            for field in model.model_fields.values():
                for each in inside(field.annotation):
                    walk(each)

    walk(Protocol)
    for offers in discover().offers.values():
        for offer in offers.values():
            walk(offer.settings)
    return list(found)


FIELDS = {
    f"{model.__module__.partition('.')[0]}.{model.__name__}.{name}": (name, field)
    for model in models()
    for name, field in model.model_fields.items()
    if _shape(field.annotation) is not None
}


def reasonable(name: str, field: FieldInfo) -> Any:
    """Return the key's default, or a number between those that its unit or mark calls usual."""
    default = field.get_default(call_default_factory=True)
    if isinstance(default, int | float | tuple) and default:
        return default
    size = usual(field)
    least, most = (
        (size.least, size.most) if size else PLAUSIBLE[unit_of(name, field.metadata) or ""]
    )
    least = least or most / 1e4
    middle = math.sqrt(least * most)
    return (middle, middle) if _shape(field.annotation) is list else middle


def told(name: str, field: FieldInfo, value: Any) -> bool:
    """Whether a value is refused, or its size asked about."""
    try:
        TypeAdapter(Annotated[field.annotation, *field.metadata, None]).validate_python(value)  # type: ignore[name-defined, valid-type]
    except ValidationError:
        return True
    size, (least, most) = usual(field), PLAUSIBLE[unit_of(name, field.metadata) or ""]
    if size:
        least, most = max(least, size.least), min(most, size.most)
    flat = [abs(each) for each in (value if isinstance(value, tuple) else (value,))]
    return any(each and not least <= each <= most for each in flat)


def times(value: Any, factor: float) -> Any:
    if isinstance(value, tuple):
        return tuple(times(each, factor) for each in value)
    return type(value)(value * factor) if factor > 1 or isinstance(value, float) else 0


def judged(name: str, field: FieldInfo) -> bool:
    """Whether a number of a key that is much too large is told, and one that is too small."""
    value = reasonable(name, field)
    large = told(name, field, times(value, 1000))
    # A count of none, and a place at the origin, are refused or as good as 0.
    whole = 0 in (value if isinstance(value, tuple) else (value,)) or isinstance(value, int)
    whole = whole or (isinstance(value, tuple) and isinstance(value[0], int))
    small = whole or told(name, field, times(value, 0.001))
    return large and small


def test_a_number_a_thousand_times_too_large_or_too_small_is_refused_or_asked_about() -> None:
    silent = {key.partition(".")[2] for key, of in FIELDS.items() if not judged(*of)}
    assert len(FIELDS) > 150
    assert silent - set(ANY) == set(), "mark them with Usual, or say why any number can be meant"
    assert set(ANY) - silent == set(), "let off, and told all the same"


def test_the_spread_is_less_than_a_thousand() -> None:
    assert 1 < SPREAD < 1000
