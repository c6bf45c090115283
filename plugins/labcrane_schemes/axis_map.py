"""Axis map: which axis does what, from the names a protocol writes."""

from collections.abc import Mapping, Sequence

from labcrane import ProtocolError
from labcrane.core import Layout

Axis = tuple[int, float]
"""Place in the input's array, and 1 or -1."""


def check_joints(names: Sequence[str], wanted: Mapping[str, str]) -> None:
    """Refuse a map that does not name exactly the machine's joints."""
    for joint in wanted:
        if joint not in names:
            raise ProtocolError(f"map names joint {joint!r}; the machine has {', '.join(names)}")
    for joint in names:
        if joint not in wanted:
            raise ProtocolError(
                f"map has no axis for joint {joint!r}; it needs one for each of {', '.join(names)}"
            )


def find_axis(axes: Layout, name: str) -> Axis:
    """Return where an axis sits, and its sign; ``-right.y`` is ``right.y`` turned round."""
    return axes.index(name.removeprefix("-")), -1.0 if name.startswith("-") else 1.0


def find_axes(axes: Layout, order: Sequence[str], wanted: Mapping[str, str]) -> tuple[Axis, ...]:
    """Return the axis of everything in ``order``; no two may share one."""
    found: dict[int, str] = {}
    result = []
    for key in order:
        if key not in wanted:
            raise ProtocolError(
                f"map has no axis for {key!r}; it needs one for each of {', '.join(order)}"
            )
        try:
            index, sign = find_axis(axes, wanted[key])
        except ProtocolError as error:
            error.add_note(f"map asks for it to move {key!r}")
            raise
        if index in found:
            raise ProtocolError(
                f"axis {axes.columns[index]!r} is mapped to both {found[index]!r} and {key!r}; "
                "give each its own"
            )
        found[index] = key
        result.append((index, sign))
    return tuple(result)
