"""Units of numbers in a file: a plain number has the key's own, any other is written beside it.

``width: 0.5`` and ``width: 50 cm`` are the same where metres are asked for. What a key asks for is
said by a mark on its type, or by the end of its name: ``limit_s``, ``size_m``, ``alpha_deg``.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pint

KINDS: Mapping[str, tuple[str, str]] = {
    "m": ("a length", "50 cm"),
    "mm": ("a length", "2 cm"),
    "s": ("a time", "200 ms"),
    "deg": ("an angle", "0.5 rad"),
    "rad": ("an angle", "90 deg"),
    "arcmin": ("an angle", "0.3 deg"),
    "Hz": ("a rate", "1 kHz"),
    "kg": ("a mass", "500 g"),
    "N": ("a force", "1 kN"),
    "N m": ("a torque", "1 kN m"),
    "m/s": ("a speed", "30 cm/s"),
    "deg/s": ("an angular speed", "0.2 rad/s"),
    "1/s": ("a rate", "2 Hz"),
    "day": ("a time", "2 weeks"),
    "ppm": ("a share", "0.01 %"),
    "uV": ("a voltage", "0.1 mV"),
    "px": ("a number of pixels", "1920 px"),
}
"""The quantity that each unit of keys measures, and how one could be written in another unit."""

ENDINGS: Mapping[str, str] = {
    "_deg_s": "deg/s",
    "_m_s": "m/s",
    "_per_s": "1/s",
    "_s": "s",
    "_m": "m",
    "_mm": "mm",
    "_arcmin": "arcmin",
    "_deg": "deg",
    "_hz": "Hz",
    "_kg": "kg",
    "_n": "N",
    "_uv": "uV",
    "_days": "day",
}
"""Units by the end of a key's name; the first that fits holds."""

SPELT = r"^[-+]?[0-9.]+(e[-+]?[0-9]+)? *[A-Za-zµ°Ω][^\n]{0,29}$"
"""A quantity, for a schema."""

_QUANTITY = re.compile(
    r"\s*(?P<number>[-+]?[\d.,]+(?:e[-+]?\d+)?)\s*(?P<unit>[A-Za-zµμ°Ω%].{0,29})?\s*", re.I
)
_PART = re.compile(r"[-+]?[\d.]+\s*[A-Za-zµμ°]+")
_SEVERAL = re.compile(r"\s*[\d.]+\s*[A-Za-zµμ°]+(?:\s+[\d.]+\s*[A-Za-zµμ°]+)+\s*")
_CLOCK = re.compile(r"\s*(\d{1,4}):(\d\d)\s*")
_UNIT = re.compile(r"%|[A-Za-zµμ°Ω]+[A-Za-z²³\^\d\s*/·-]*")
_MORE = re.compile(r"\d{3}|\^[^\d-]|\*\*")


@dataclass(frozen=True, slots=True)
class Unit:
    """A mark on a key's type: the unit of its numbers, as in ``Annotated[float, Unit("m")]``.

    Attributes
    ----------
    name
        One of :data:`KINDS`.
    """

    name: str


class Unread(str):
    """A quantity in a list that cannot be read, with the reason: pydantic says which item it is."""

    __slots__ = ("why",)

    why: str


def unit_of(key: str, metadata: list[Any]) -> str | None:
    """Return the unit that a key's numbers have; None where it says none."""
    for mark in metadata:
        if isinstance(mark, Unit):
            return mark.name
    return next((unit for end, unit in ENDINGS.items() if key.endswith(end)), None)


def in_unit(text: str, unit: str) -> float | None:
    """Return a quantity, ``50 cm``, as a number of ``unit``; None where there is none to be seen.

    Raises
    ------
    ValueError
        Its unit is unknown, or measures something else.
    """
    if unit == "s" and (clock := _CLOCK.fullmatch(text)):
        seconds = 60 * int(clock[1]) + int(clock[2])
        raise ValueError(
            f"{text!r} is not a number of seconds; write {seconds} for {text} minutes, or "
            f"{seconds} s"
        )
    if _SEVERAL.fullmatch(text):  # 1 min 30 s
        return float(f"{sum(in_unit(part, unit) or 0.0 for part in _PART.findall(text)):.12g}")
    found = _QUANTITY.fullmatch(text)
    if found is None or found["unit"] is None:
        return None
    written, of = found["number"], found["unit"].strip()
    if "," in written:
        raise ValueError(
            f"{text!r} has a comma; write decimals with a point: {written.replace(',', '.')} {of}"
        )
    try:
        number = float(written)
    except ValueError:
        return None
    kind, example = KINDS[unit]
    asked = (
        f"where {kind} is required; write a plain number, in {unit}, or {kind} with its unit, as "
        f"{example}"
    )
    if not _UNIT.fullmatch(of) or _MORE.search(of):
        raise ValueError(f"{text!r} has no known unit, {asked}")
    if of.lower() == "fps" and unit in {"Hz", "1/s"}:  # of pictures, and not of feet
        return number
    return _converted(number, of, unit, text, asked)


def _converted(number: float, of: str, unit: str, text: str, asked: str) -> float:
    """Return a number of a unit as one of another; ``text`` and ``asked`` are for the message."""
    import pint  # noqa: PLC0415 - most files have plain numbers

    units = _registry()
    failures = (pint.errors.PintError, ArithmeticError, AttributeError, TypeError)
    try:
        measured = units.parse_units(of.replace("°", "deg").replace("%", "percent"))
    except (ValueError, *failures) as error:  # as of "min 30"
        raise ValueError(f"{text!r} has no known unit, {asked}") from error
    try:
        quantity = units.Quantity(number, measured)
        if _root(quantity.units) != _root(unit):
            root = _root(quantity.units)
            kinds = (kind for name, (kind, _) in KINDS.items() if _root(name) == root)
            raise ValueError(f"{text!r} is {next(kinds, 'something else')}, {asked}")
        return float(f"{quantity.to(unit).magnitude:.12g}")
    except failures as error:
        raise ValueError(f"{text!r} has no known unit, {asked}") from error


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint  # noqa: PLC0415

    units: pint.UnitRegistry[float] = pint.UnitRegistry()
    units.define("px = pixel")  # of pictures: in print it is a length, 1/96 inch
    return units


def _root(unit: Any) -> Any:
    """Return what a unit is made of at the root: a radian is not nothing, and no cycle."""
    units = _registry()
    return units.get_root_units(units.parse_units(unit) if isinstance(unit, str) else unit)[1]


def read_quantities(value: Any, unit: str, *, several: bool) -> Any:
    """Return a key's value with every quantity in it as a number of ``unit``.

    Parameters
    ----------
    several
        Whether a list of numbers is asked for; otherwise one is.
    """
    if isinstance(value, str) and not several:
        number = in_unit(value, unit)
        return value if number is None else number
    if isinstance(value, list) and several:
        return [_read_item(each, unit) for each in value]
    return value


def _read_item(item: Any, unit: str) -> Any:
    """Return an item of a list as a number; what cannot be read is complained of in its place."""
    try:
        return read_quantities(item, unit, several=isinstance(item, list))
    except ValueError as error:
        unread = Unread(item)
        unread.why = str(error)
        return unread
