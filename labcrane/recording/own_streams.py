"""Streams of a session's own: what it sends, and those of its processes that state their error."""

from labcrane.recording.pictures import CAPTURED, TERMS

OWN_STREAMS = tuple(
    f"labcrane.{name}"
    for name in ("state", "input", "markers", "labels", "codes", "frame", "context")
)
"""Streams that every session sends (:mod:`labcrane.streams.outlets`)."""

ESTIMATED = "labcrane.estimate."
"""Prefix of the streams of estimates' values."""

STATED = ("clock",)
"""The channel in which an estimate states by how much the time of a value may be off."""


def stated_terms(name: str) -> tuple[str, ...]:
    """Return the channels in which a stream states its uncertainty; none for other programs'."""
    if name.startswith(CAPTURED):
        return TERMS
    return STATED if name.startswith(ESTIMATED) else ()
