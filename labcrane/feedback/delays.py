"""Measured delays of views and sounds, in a file in the protocol's folder."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from labcrane.errors import ProtocolError
from labcrane.files.atomic import SHARED_FILE, write_text
from labcrane.streams.edges import Delay, Kind

NOT_MEASURED = "not measured"

Facts = Mapping[str, float | int | str | bool | None]


@dataclass(frozen=True, slots=True)
class MeasuredDelay:
    """A delay, and the facts for which it is valid.

    Attributes
    ----------
    kind
        ``display``, ``audio`` or ``touch``.
    date
        When it was measured: ``2026-03-01``.
    sensor
        Name of the stream that saw it.
    facts
        Facts that the component reported: renderer, size, driver, block.
    """

    kind: Kind
    date: str
    sensor: str
    delay: Delay
    facts: Facts


def delay_path(protocol: Path) -> Path:
    """Return the path of the delays of a protocol's views and sounds."""
    return protocol.with_name(f"{protocol.stem}.delays.json")


def read_delays(protocol: Path) -> dict[str, MeasuredDelay]:
    """Return the measured delays, by the protocol's names for views and sounds.

    Raises
    ------
    ProtocolError
        The file is damaged.
    """
    path = delay_path(protocol)
    if not path.exists():
        return {}
    try:
        return _codec().validate_json(path.read_bytes())
    except ValidationError as error:
        raise ProtocolError(
            f"{path} is damaged ({error.errors()[0]['msg']}); remove it and measure again with "
            "labcrane doctor"
        ) from error


@cache
def _codec() -> TypeAdapter[dict[str, MeasuredDelay]]:
    return TypeAdapter(dict[str, MeasuredDelay])


def store(protocol: Path, name: str, measured: MeasuredDelay) -> Path:
    """Put one measurement into the file, instead of an older one; return the file."""
    path = delay_path(protocol)
    all_ = {**read_delays(protocol), name: measured}
    text = json.dumps(_codec().dump_python(all_, mode="json"), indent=2)
    write_text(path, text + "\n", SHARED_FILE)
    return path


def delay_in_words(measured: MeasuredDelay | None, facts: Facts) -> str:
    """Return the known delay of a component with these facts, in words."""
    if measured is None:
        return NOT_MEASURED
    now = {name: value for name, value in facts.items() if name != "delay"}
    other = [
        f"{name} was {measured.facts.get(name)!r}, is {now.get(name)!r}"
        for name in {**measured.facts, **now}
        if measured.facts.get(name) != now.get(name)
    ]
    if other:
        return f"{NOT_MEASURED} as it is now ({'; '.join(other)})"
    found = measured.delay
    return (
        f"{1000 * found.mean_s:.1f} ms (sd {1000 * found.sd_s:.1f} ms, {found.seen} changes, "
        f"{measured.date})"
    )
