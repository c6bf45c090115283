"""Effective values: numbers that a protocol writes with a unit, as they are used and recorded."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from labcrane.files.model import Usual, numbers
from labcrane.files.yaml import Place
from labcrane.protocol.study import Study


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with a unit in a protocol.

    Attributes
    ----------
    place
        Where it is written.
    value, unit
        What is used.
    written
        The text in the file; a plain number, or one with a unit of its own.
    usual
        Its usual size; None where that is unknown.
    """

    place: Place
    value: float
    unit: str
    written: Any
    usual: Usual | None = None


def written_quantities(study: Study) -> Iterator[Quantity]:
    """Yield every number with a unit that the protocol itself writes."""
    return (each for each in written_numbers(study) if each.unit)


def written_numbers(study: Study) -> Iterator[Quantity]:
    """Yield every number that the protocol itself writes; one without a unit has ``""``."""
    parts: dict[Place, Any] = {
        (): study.protocol,
        ("operator",): study.operator.settings,
        **{tuple(part.split(".", 1)): choice.settings for part, choice in study.choices.items()},
    }
    data = study.source.data if study.source else {}
    for place, settings in parts.items():
        for at, unit, value, size in numbers(settings):
            where = (*place, *at)
            yield Quantity(where, value, unit or "", _at(data, where), size)


def _at(node: Any, place: Place) -> Any:
    for step in place:
        try:
            node = node[step]
        except (KeyError, IndexError, TypeError):  # read from a file that the protocol names
            return None
    return node
