"""Models of YAML: strict, with units, and a schema that says what is written under a key."""

import ast
import inspect
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationInfo,
    field_validator,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticKnownError, core_schema

from labcrane.files.complaints import Truth, field_at
from labcrane.files.units import read_quantities, unit_of

UNIT = "x-unit"
"""Key of a schema that says the unit of numbers."""


class StrictModel(BaseModel):
    """A part of a file: unknown keys are errors, values never change.

    The docstring under a key describes it in the JSON Schema: read when a schema is made, and not,
    as by pydantic's ``use_attribute_docstrings``, by every command that imports a model.
    """

    # A model that is a part of others is never validated alone: its own validator is not built.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    @field_validator("*", mode="before")
    @classmethod
    def _in_its_own_unit(cls, value: Any, info: ValidationInfo) -> Any:
        """Take ``50 cm`` where a number of metres is asked for."""
        if not isinstance(value, str | list | dict | bool) or info.field_name is None:
            return value
        field = cls.model_fields[info.field_name]
        unit = unit_of(info.field_name, field.metadata)
        shape = _shape(field.annotation)
        if not was_run(info):
            value = _no_truth(field.annotation, value)
        if unit is None or shape is None or not isinstance(value, str | list):
            return value
        return read_quantities(value, unit, several=shape is list)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Say of every key what it is, and its unit."""
        written = handler(core)
        keys = handler.resolve_ref_schema(written).get("properties", {})
        said = descriptions(cls)
        for name, field in cls.model_fields.items():
            unit, key = unit_of(name, field.metadata), field.alias or name
            if key in keys and name in said:
                keys[key].setdefault("description", said[name])
            if unit is not None and key in keys and _shape(field.annotation) is not None:
                keys[key][UNIT] = unit
        return written


@cache
def descriptions(model: type[BaseModel]) -> Mapping[str, str]:
    """Return the docstrings under a model's keys; none of a class whose source is not there."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, BaseModel) and base.__module__.partition(".")[0] != "pydantic":
            found |= dict(_docstrings(base))
    return {name: text for name, text in found.items() if name in model.model_fields}


def _docstrings(of: type) -> Iterator[tuple[str, str]]:
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(of)))
    except (OSError, TypeError, SyntaxError):
        return
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    for key, under in pairwise(body):
        match key, under:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                yield name, inspect.cleandoc(text)


def _no_truth(annotation: Any, value: Any) -> Any:
    """Refuse ``true`` where a number is required: it would be read as 1.

    It becomes a :class:`Truth`, so that it is refused at its own place, in a list as well.
    """
    while hasattr(annotation, "__metadata__"):
        annotation = get_args(annotation)[0]
    origin, arguments = get_origin(annotation), get_args(annotation)
    if isinstance(value, bool):
        kinds = set(_plain_types(annotation))
        if kinds & {int, float} and not kinds & {bool, Any}:
            if str not in kinds:
                return Truth(str(value).lower())
            raise ValueError(f"{str(value).lower()} is not a number; write one")
    elif isinstance(value, list | dict) and origin in {Union, UnionType}:
        for one in arguments:  # one of them, at most, is of this kind
            value = _no_truth(one, value)
    elif isinstance(value, list) and (origin in {tuple, list} or _named_items(annotation)):
        of: Any = Union[arguments or _named_items(annotation)]  # noqa: UP007 - of what is only known now
        return [_no_truth(of, each) for each in value]
    elif isinstance(value, dict) and origin is dict:
        return {key: _no_truth(arguments[1], each) for key, each in value.items()}
    return value


def _plain_types(annotation: Any) -> Iterator[Any]:
    """Yield the types that a value of a type can be, behind unions and marks."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in {Union, UnionType}:
        for each in arguments:
            yield from _plain_types(each)
    elif hasattr(annotation, "__metadata__"):
        yield from _plain_types(arguments[0])
    elif origin is Literal:
        yield from map(type, arguments)
    else:
        yield annotation


def number_at(model: type[BaseModel], place: Sequence[str | int]) -> tuple[str | int, ...]:
    """Return where the key of a number is, which has a default, at a place or around it.

    Empty where there is none.
    """
    keys = [at for at, step in enumerate(place) if isinstance(step, str)]
    key = tuple(place[: keys[-1] + 1]) if keys else ()
    field = field_at(model, key)
    is_number = field is not None and not field.is_required() and _shape(field.annotation)
    return key if is_number else ()


def was_run(info: ValidationInfo) -> bool:
    """Return whether what is validated is the record of a session that was run.

    A validator that only checks, and changes nothing, asks this first and lets a record pass. The
    record was accepted by the rules of its time; later rules must not make it unusable for replay
    and for continuing the session.

    Examples
    --------
    >>> class Lamp(Settings):
    ...     colours: tuple[str, ...]
    ...
    ...     @field_validator("colours")
    ...     @classmethod
    ...     def _differ(cls, colours: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    ...         if not was_run(info) and len(set(colours)) < len(colours):
    ...             raise ValueError("a colour is listed twice")
    ...         return colours
    """
    return bool(info.context and info.context.get("recorded"))


@dataclass(frozen=True, slots=True)
class AtMost:
    """A mark of a number that may not be larger before a session is run; a record may hold more.

    Attributes
    ----------
    limit
        The largest number.

    Examples
    --------
    >>> class Drill(Settings):
    ...     rounds: Annotated[PositiveInt, AtMost(1000)] = 1
    """

    limit: int

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Judge a number that is otherwise right."""
        return core_schema.with_info_after_validator_function(self._judge, handler(source))

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Say the limit in the schema."""
        return handler(core) | {"maximum": self.limit}

    def _judge(self, value: int, info: ValidationInfo) -> int:
        if value > self.limit and not was_run(info):
            raise PydanticKnownError("less_than_equal", {"le": self.limit})
        return value


@dataclass(frozen=True, slots=True)
class Usual:
    """A mark of a number that is asked about where it is not of a usual size; 0 always is.

    A number whose default is not 0 needs none: it is asked about beyond :data:`SPREAD` times its
    default, and below a :data:`SPREAD` th of it.

    Attributes
    ----------
    least, most
        Between which sizes it is usual, in the key's unit.

    Examples
    --------
    >>> class Drill(Settings):
    ...     delay_s: Annotated[NonNegativeFloat, Usual(0.001, 5.0)] = 0.0
    """

    least: float
    most: float


SPREAD = 100.0


def usual(field: FieldInfo) -> Usual | None:
    """Return of what size a key's number usually is, as marked or as its default; or None."""
    for mark in field.metadata:
        if isinstance(mark, Usual):
            return mark
    default = field.get_default(call_default_factory=False)
    sizes = [abs(float(each)) for each in _flat(default)]
    if _shape(field.annotation) is None or not any(sizes):
        return None
    return Usual(min(sizes) / SPREAD, max(sizes) * SPREAD)


def _flat(value: Any) -> Iterator[float]:
    if isinstance(value, list | tuple):
        for each in value:
            yield from _flat(each)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value


Number = tuple[tuple[str | int, ...], str | None, float, Usual | None]
"""Where a number is, its unit, if it has one, its value, and of what size it usually is."""


def numbers(model: BaseModel) -> Iterator[Number]:
    """Yield every number that was written into a model."""
    for name in type(model).model_fields:
        if name in model.model_fields_set:
            field, value = type(model).model_fields[name], getattr(model, name)
            unit = unit_of(name, field.metadata)
            if _shape(field.annotation) is None:
                unit = None
            yield from _numbers((field.alias or name,), unit, value, usual(field))


def _numbers(
    place: tuple[str | int, ...], unit: str | None, value: Any, size: Usual | None
) -> Iterator[Number]:
    if isinstance(value, BaseModel):
        for inside, its, number, its_size in numbers(value):
            yield (*place, *inside), its, number, its_size
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from _numbers((*place, key), None, each, None)
    elif isinstance(value, list | tuple):
        for at, each in enumerate(value):
            yield from _numbers((*place, at), unit, each, size)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield place, unit, float(value), size


def _named_items(annotation: Any) -> tuple[Any, ...]:
    """Return the types of a named tuple's items; none of anything else."""
    if not (isinstance(annotation, type) and issubclass(annotation, tuple)):
        return ()
    return tuple(get_type_hints(annotation).values())


def _shape(annotation: Any) -> type | None:
    """Return whether a key asks for a number (float) or numbers (list); None for anything else."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if annotation in {int, float}:
        return float
    if origin in {tuple, list} or _named_items(annotation):
        items = arguments or _named_items(annotation)
        return list if any(_shape(each) for each in items) else None
    if origin in {Union, UnionType}:
        return next((shape for each in arguments if (shape := _shape(each))), None)
    return _shape(arguments[0]) if arguments and hasattr(annotation, "__metadata__") else None
