"""Requests for the streams that a recording needs."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from labcrane.errors import StreamError

if TYPE_CHECKING:
    import pylsl

MARKER_TYPES = frozenset({"marker", "markers", "event", "events"})
"""One thing under four names; the XDF convention is Markers."""

OURS = "labcrane."
"""Streams of labcrane itself are recorded when asked for by name or source id only."""

Identity = tuple[str, str, str]
"""What a stream is known again by when its program is started again: its source id, where it has
one that lasts, its name and its type."""

NOBODY: Identity = ("", "", "")
"""No stream: one that is asked for by its type has a type."""

RANDOM_ID = re.compile(r"-?[0-9]{15,20}")
"""What pylsl makes up when a program gives no source id: another one in every process."""


@dataclass(frozen=True, slots=True)
class StreamRequest:
    """A stream, or several of one type, to be recorded.

    Attributes
    ----------
    label
        What the protocol calls it.
    type, name, source_id
        What it must have; None is anything. One of them is needed.
    required
        Whether a session needs it.
    rate_hz, channels
        What is expected of it; None is anything.
    counter
        Label of a channel that counts samples, to find lost ones.
    stamped
        When its samples get their timestamps, if the protocol says so.
    several
        Whether all streams that fit are meant, and not one.
    any_meant
        Whether a protocol is written for any stream of the type, each laboratory's own: a run asks
        all the same which one it is.
    confirmed
        The confirmed stream of the type, :data:`NOBODY` if none is meant; None before the
        question.
    """

    label: str
    type: str | None = None
    name: str | None = None
    source_id: str | None = None
    required: bool = True
    rate_hz: float | None = None
    channels: int | None = None
    counter: str | None = None
    stamped: str | None = None
    several: bool = False
    any_meant: bool = False
    confirmed: Identity | None = None

    def __post_init__(self) -> None:
        if self.type is None and self.name is None and self.source_id is None:
            raise StreamError(
                f"stream {self.label!r} matches every stream: give its type, name or source_id"
            )

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> "StreamRequest":
        """Return the request that JSON holds."""
        known = cls.__dataclass_fields__
        if unknown := sorted(set(fields) - set(known)):
            raise StreamError(
                f"a stream request has no {', '.join(unknown)}; it has {', '.join(known)}"
            )
        confirmed = fields.get("confirmed")
        return cls(**{**fields, "confirmed": None if confirmed is None else tuple(confirmed)})

    def matches(self, info: "pylsl.StreamInfo") -> bool:
        """Whether a stream is one of those asked for, or may be."""
        if self.confirmed is not None:
            return identity(info) == self.confirmed
        if self.name is not None and info.name() != self.name:
            return False
        if self.source_id is not None and info.source_id() != self.source_id:
            return False
        if self.type is None:
            return True
        return same_type(self.type, info.type()) and not (
            self.by_type_alone and info.name().startswith(OURS)
        )

    @property
    def by_type_alone(self) -> bool:
        """Whether any stream of a type fits, a neighbour's as well."""
        return self.name is None and self.source_id is None

    @property
    def asks(self) -> bool:
        """Whether a stream of a type must be confirmed first."""
        return self.by_type_alone and not self.several and self.confirmed is None

    def taken(self, name: str, source_id: str, host: str) -> str | None:
        """Say which stream was taken where any of its type would have fitted; else None."""
        if not self.by_type_alone or self.several:
            return None
        return (
            f"is requested by type {self.type!r} only, and was confirmed: it is {name!r} "
            f"(source_id {source_id!r}) of {host}"
        )

    def misfits(self, channels: int, rate_hz: float) -> list[str]:
        """Say in which way a stream is not what was expected."""
        found = []
        if self.channels is not None and channels != self.channels:
            found.append(f"has {channels} channels; {self.channels} are expected")
        if self.rate_hz is not None and abs(rate_hz - self.rate_hz) > 0.01 * self.rate_hz:
            found.append(f"has a nominal rate of {rate_hz:g} Hz; {self.rate_hz:g} Hz are expected")
        return found

    def __str__(self) -> str:
        wanted = {"type": self.type, "name": self.name, "source_id": self.source_id}
        return f"{self.label} ({', '.join(f'{k} {v!r}' for k, v in wanted.items() if v)})"


def identity(info: "pylsl.StreamInfo") -> Identity:
    """Return what a stream is known again by."""
    lasts = unstable_id(info.source_id()) is None
    return info.source_id() if lasts else "", info.name(), info.type()


def same_type(wanted: str, actual: str) -> bool:
    """Whether a stream's type is the one that is wanted, under whichever of its names."""
    if wanted.lower() in MARKER_TYPES:
        return actual.lower() in MARKER_TYPES
    return wanted == actual


def unstable_id(source_id: str) -> str | None:
    """Say why a stream could not be found again after a restart; None when it could."""
    if not source_id:
        return (
            "has no source_id, so it cannot be found again after a restart: set one in its program"
        )
    if RANDOM_ID.fullmatch(source_id):
        return (
            f"has source_id {source_id}, probably made up by pylsl and new at every start: "
            "set one in its program"
        )
    return None
