"""Complaints of pydantic in the terms of YAML: the value in the file, and the allowed ones."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from difflib import get_close_matches
from math import isfinite
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from labcrane.errors import suggestion
from labcrane.files.units import KINDS, Unread, unit_of

Place = tuple[str | int, ...]
"""The keys and indices that lead to a value: ``("sessions", 0, "steps", 2)``."""


class Truth(str):
    """``true`` or ``false`` where a number is asked for: pydantic would take it for 1 or 0."""

    __slots__ = ()


class WrongKey(ValueError):  # noqa: N818 - no error of labcrane's, but a complaint about a key
    """A complaint of a validator of several keys about one of them: a check points there.

    Parameters
    ----------
    at
        The keys and indices, below what is validated, that lead to what is wrong.

    Examples
    --------
    >>> class Zone(Settings):
    ...     inner_m: float
    ...     outer_m: float
    ...
    ...     @model_validator(mode="after")
    ...     def _rises(self) -> Self:
    ...         if self.inner_m >= self.outer_m:
    ...             raise WrongKey(f"{self.outer_m:g} is too small", at=("outer_m",))
    ...         return self
    """

    def __init__(self, message: str, *, at: Sequence[str | int]) -> None:
        super().__init__(message)
        self.at = tuple(at)


OF_KEYS = "[key]"
"""How pydantic ends the place of a mapping's key."""

_MEMBER = re.compile(r"\[.*[\]'\"]|^(constrained-)?(str|int|float|bool)$")
_PERCENT = re.compile(r"\s*(-?(?:\d+\.?\d*|\.\d+))\s*%\s*")
_COMMA = re.compile(r"\s*-?\d+,\d+\s*")


@dataclass(frozen=True, slots=True)
class Complaint:
    """A mistake and its place: the value there, or its key."""

    place: Place
    message: str
    key: bool = False


def told(
    errors: Sequence[ErrorDetails], place: Place, model: type[BaseModel]
) -> Iterator[Complaint]:
    """Yield the complaints of pydantic; one for a value that fits no member of a union.

    Pydantic itself complains once for every member, each as if it were the only one.
    """
    unions: dict[Place, list[ErrorDetails]] = {}
    inside: set[Place] = set()
    for each in map(_of_one_key, errors):
        loc = each["loc"]
        if _follows(each, errors):
            continue
        if each["type"] == "missing" and (meant := _meant(each)):
            holder = named((*place, *loc[:-1]))
            said = (
                f"there is no space after the colon of {str(loc[-1])!r}; add one"
                if meant.startswith(f"{loc[-1]}:")
                else f"{holder} needs {str(loc[-1])!r}; did you write it as {meant!r}?"
            )
            yield Complaint((*loc[:-1], meant), said, key=True)
            continue
        if of_key := loc[-1:] == (OF_KEYS,):
            loc = loc[:-1]
        at = next((n for n, step in enumerate(loc) if is_member(step)), None)
        if at is None or at + 1 < len(loc):
            of_key = of_key or each["type"] == "extra_forbidden"
            inside |= {loc[:at]} if at is not None else set()
            yield Complaint(loc, explain(each, place, model), of_key)
        else:
            unions.setdefault(loc[:at], []).append(each)
    for loc, several in unions.items():
        if loc in inside:  # it is one of the members, with something wrong in it
            continue
        texts = [explain(each, place, model) for each in several]
        head = texts[0].partition("; it must be ")[0]
        wanted = [text.partition("; it must be ")[2] or text for text in texts]
        yield Complaint(loc, f"{head}; it must be {', or '.join(dict.fromkeys(wanted))}")


def _of_one_key(error: ErrorDetails) -> ErrorDetails:
    """Return a complaint with the place that a :class:`WrongKey` says."""
    why = error.get("ctx", {}).get("error")
    return {**error, "loc": (*error["loc"], *why.at)} if isinstance(why, WrongKey) else error


def _follows(error: ErrorDetails, errors: Sequence[ErrorDetails]) -> bool:
    """Whether a complaint only follows from others: too few items, of which some are wrong."""
    loc, kind = error["loc"], error["type"]
    if kind == "too_short":
        return any(
            len(each["loc"]) > len(loc) and each["loc"][: len(loc)] == loc for each in errors
        )
    if kind == "missing" and isinstance(loc[-1], int):  # of several, the last says how many
        return any(
            each["type"] == kind and each["loc"][:-1] == loc[:-1] and each["loc"][-1] > loc[-1]  # type: ignore[operator]  # both are indices
            for each in errors
        )
    return False


def _meant(error: ErrorDetails) -> str | None:
    """Return the key that is there and looks like one that is missing."""
    there, wanted = error["input"], error["loc"][-1]
    if not isinstance(there, Mapping) or not isinstance(wanted, str):
        return None
    keys = [str(key) for key in there]
    joined = [key for key in keys if key.startswith(f"{wanted}:")]
    return next(iter(joined or get_close_matches(wanted, keys, n=1, cutoff=0.65)), None)


def explain(error: ErrorDetails, place: Place, model: type[BaseModel]) -> str:
    """Return the written value and the possible ones, for one of pydantic's complaints."""
    loc = error["loc"]
    key = loc[-1] if loc else named(place)
    if error["type"] == "extra_forbidden":
        return _no_key(str(key), model, place, loc[:-1])
    if error["type"] == "missing" and isinstance(key, int):
        holder = named((*place, *loc[:-1]))
        return f"{holder} is {shown(error['input'])}; it needs {key + 1} items"
    if error["type"] == "missing":
        return f"{named((*place, *loc[:-1]))} needs {str(key)!r}"
    name = named((*place, *(step for step in loc if not is_member(step))))
    if isinstance(error["input"], Truth):
        return f"{name}: {error['input']} is not a number; write one"
    if isinstance(error["input"], Unread):
        return f"{name}: {error['input'].why}"
    what = error["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if error["type"] == "value_error":
        return f"{name}: {what}"
    if error["type"] in {"too_short", "too_long"}:
        return f"{name} is {shown(error['input'])}; {_how_many(error)}"
    if error["type"] == "string_pattern_mismatch":
        pattern = error.get("ctx", {}).get("pattern", "")
        what = PATTERNS.get(pattern, f"of the form {pattern}")
    what = WANTED.get(error["type"], what)
    return f"{name} is {shown(error['input'])}; it must be {_number(error, model, what)}"


def _number(error: ErrorDetails, model: type[BaseModel], what: str) -> str:
    """Return which number must be there: in which unit, and with a point; others as they are."""
    unit = _unit(error, model)
    if error["type"] in BOUNDS:
        return f"{what} {unit}" if unit else what
    if what not in NUMBERS:
        return what
    if isinstance(error["input"], str) and _COMMA.fullmatch(error["input"]):
        return f"{what}; write decimals with a point: {error['input'].strip().replace(',', '.')}"
    unit = _unit(error, model)
    if (
        not unit
        and isinstance(error["input"], str)
        and (share := _PERCENT.fullmatch(error["input"]))
    ):
        return f"{what}; write {float(share[1]) / 100:g} for {share[0].strip()}"
    return f"{what} in {unit}, or one with its unit, as {KINDS[unit][1]}" if unit else what


def _unit(error: ErrorDetails, model: type[BaseModel]) -> str | None:
    """Return the unit of the number that is complained of; None where it has none."""
    keys = [step for step in error["loc"] if isinstance(step, str) and not is_member(step)]
    field = field_at(model, error["loc"])
    return unit_of(keys[-1], field.metadata) if field and keys else None


WANTED = {
    "tuple_type": "a list: [.., ..]",
    "list_type": "a list: [.., ..]",
    "dict_type": "a mapping of keys: {key: value}",
    "model_type": "a mapping of keys: {key: value}",
    "string_type": "text; put it in quotation marks if it is",
    "string_too_short": "text that is not empty",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number, and a smaller one",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_parsing": "true or false",
    "path_type": "the name of a file",
    "finite_number": "a finite number: neither .nan nor .inf",
}
"""Names of pydantic's types for people who write YAML."""

BOUNDS = {"greater_than", "greater_than_equal", "less_than", "less_than_equal"}

NUMBERS = {"a number", "a whole number"}

PATTERNS = {
    "^[0-9a-f]{4}:[0-9a-f]{4}$": "vendor and product of a USB device, four hexadecimal digits "
    "each, as 044f:b10a",
    "^#[0-9a-fA-F]{6}$": "red, green and blue in hexadecimal, in quotation marks, as '#0d47a1'",
    "^[a-z][a-z0-9_-]*$": "lower-case letters, digits, hyphens and underscores, a letter first",
    "^[a-z][a-z0-9_]*$": "lower-case letters, digits and underscores, a letter first",
    "^-?[a-z][a-z0-9_.]*$": "the name of an axis, such as left.x, or -left.x to reverse it",
}
"""Patterns in words."""

MOST_SHOWN = 60
"""Characters of a value that a message repeats."""


def shown(value: object) -> str:
    """Return a value as a message repeats it: a whole section is not printed over a screen."""
    text = written(value)
    if len(text) <= MOST_SHOWN:
        return text
    if isinstance(value, Mapping):
        return f"a mapping of {', '.join(map(str, value))}"[:MOST_SHOWN]
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    return f"{text[:MOST_SHOWN]}..."


def written(value: object) -> str:
    """Return a value as people write it in YAML."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not isfinite(value):
        return {"nan": ".nan", "inf": ".inf", "-inf": "-.inf"}[str(value)]
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {written(each)}' for key, each in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(written, value))}]"
    return repr(value)


def _how_many(error: ErrorDetails) -> str:
    about = error.get("ctx", {})
    if error["type"] == "too_short":
        return f"it needs at least {about.get('min_length')}"
    return f"it can have at most {about.get('max_length')}"


def is_member(step: object) -> bool:
    """Whether part of pydantic's location is its name for a member of a union."""
    return isinstance(step, str) and bool(_MEMBER.search(step))


def _no_key(key: str, model: type[BaseModel], place: Place, loc: Place) -> str:
    """Return that what holds a key has none of that name, and which it has."""
    inside, holder = _model_at(model, loc), named((*place, *loc))
    if inside is not None and not inside.model_fields:
        return f"{key!r} is not a key of {holder}, which has no keys; remove it"
    there = suggestion(key, inside.model_fields if inside else (), "possible:")
    return f"{key!r} is not a key of {holder}; {there}"


def field_at(model: type[BaseModel], loc: Place) -> FieldInfo | None:
    """Return the field of the last key of a place; None if no model has that key."""
    keys = [at for at, step in enumerate(loc) if isinstance(step, str) and not is_member(step)]
    holder = _model_at(model, loc[: keys[-1]]) if keys else None
    return holder.model_fields.get(str(loc[keys[-1]])) if holder else None


def _model_at(model: type[BaseModel], place: Place) -> type[BaseModel] | None:
    """Return the model that describes the value at a place; None if no model does."""
    at: Any = model
    for step in place:
        if not is_member(step):
            at = next(_under(at, step), None)
    return next(_models(at), None)


def _under(annotation: Any, step: str | int) -> Iterator[Any]:
    """Yield the annotations of the value under a key, or of an item of a list."""
    if hasattr(annotation, "__metadata__"):
        annotation = annotation.__origin__
    origin, arguments = get_origin(annotation), get_args(annotation)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if step in annotation.model_fields:
            yield annotation.model_fields[str(step)].annotation
    elif origin in {Union, UnionType}:
        for each in arguments:
            yield from _under(each, step)
    elif origin is dict and isinstance(step, str):
        yield arguments[1]
    elif origin in {tuple, list} and isinstance(step, int):
        yield (
            arguments[min(step, len(arguments) - 1)] if Ellipsis not in arguments else arguments[0]
        )


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models that are an annotation, one of its members, or its items."""
    if hasattr(annotation, "__metadata__"):
        annotation = annotation.__origin__
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif get_origin(annotation) in {tuple, list, Union, UnionType}:
        for each in get_args(annotation):
            yield from _models(each)


def named(place: Place) -> str:
    """Return a place as a message names it: ``sessions[1].steps[2]``, items from 1.

    Pydantic's names for members of a union, ``function-after[_maps(), ByEstimate]``, are left out.
    """
    text = ""
    for step in (each for each in place if not is_member(each)):
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text or "the file"
