"""Streams of a session's own processes: on its clock already, with the uncertainty they state."""

from labcrane.recording.pictures import CAPTURED, TERMS

ESTIMATED = "labcrane.estimate."
"""Prefix of the streams of estimates' values."""

STATED = ("clock",)
"""The channel in which an estimate states by how much the time of a value may be off."""


def stated_terms(name: str) -> tuple[str, ...]:
    """Return the channels in which a stream states its uncertainty; none for other programs'."""
    if name.startswith(CAPTURED):
        return TERMS
    return STATED if name.startswith(ESTIMATED) else ()
