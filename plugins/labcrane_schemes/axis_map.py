"""Axis map: which axis does what, from the names a protocol writes."""

from collections.abc import Mapping, Sequence

from labcrane.core import Layout

Axis = tuple[int, float]
"""Place in the input's array, and 1 or -1."""


def find_axis(axes: Layout, name: str) -> Axis:
    """Return where an axis sits, and its sign; ``-right.y`` is ``right.y`` turned round."""
    return axes.index(name.removeprefix("-")), -1.0 if name.startswith("-") else 1.0


def find_axes(axes: Layout, order: Sequence[str], wanted: Mapping[str, str]) -> tuple[Axis, ...]:
    """Return the axis of everything in ``order``; a check of the protocol has found each."""
    return tuple(find_axis(axes, wanted[key]) for key in order)
