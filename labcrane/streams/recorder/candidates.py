"""Candidates for streams that are requested by type only, until one of them is confirmed.

A neighbour's amplifier is of the same type as one's own. So nothing of a candidate is recorded: its
people were not asked, and who looks at the recording could not tell it from the right one.

A confirmation holds for one session: remembered on a computer, a protocol would mean something else
on each one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from labcrane.errors import StreamError
from labcrane.streams.request import NOBODY, Identity, identity

if TYPE_CHECKING:
    import pylsl

NONE = "none"
"""The answer that no stream that is there is the one."""


@dataclass(frozen=True, slots=True, order=True)
class Candidate:
    """A stream that may be the one that is meant, ready for JSON."""

    identity: Identity
    host: str

    @classmethod
    def of(cls, info: "pylsl.StreamInfo") -> "Candidate":
        """Return a stream as a candidate."""
        return cls(identity(info), info.hostname())

    @classmethod
    def read(cls, fields: Mapping[str, Any]) -> "Candidate":
        """Return the candidate that JSON holds."""
        source_id, name, kind = fields["identity"]
        return cls((source_id, name, kind), fields["host"])

    def is_called(self, word: str) -> bool:
        """Whether a word names it; an empty word names every candidate."""
        return word in ("", *self.identity[:2])

    def __str__(self) -> str:
        return called(self.identity) + f" of {self.host}"


def called(identity: Identity) -> str:
    """Return a stream in words."""
    source_id, name, _ = identity
    return f"{name!r} ({f'source_id {source_id!r}' if source_id else 'no persistent source_id'})"


def question(label: str, kind: str, candidates: Sequence[Candidate], *, required: bool) -> str:
    """Ask which stream of a type is meant."""
    which = "; or ".join(map(str, candidates))
    lone = len(candidates) == 1
    how = f"take {label}" if lone else f"take {label}=SOURCE_ID (or its name)"
    leave = "" if required else f", or take {label}={NONE} to leave it out"
    return (
        f"is requested by type {kind!r} only. Record {which}? Enter {how}{leave}. To avoid this "
        "question, set source_id in the protocol"
    )


def answered(text: str, streams: Sequence[Mapping[str, Any]]) -> tuple[str, Identity]:
    """Return which stream of the study an answer is about, and which one is meant.

    Parameters
    ----------
    text
        ``"eeg"`` for the only candidate, ``"eeg=amplifier-1"`` for the one with that source id or
        name, ``"eeg=none"`` to record without it.
    streams
        How the study's streams are, as a recorder tells.

    Raises
    ------
    StreamError
        It answers no question, or more than one stream fits.
    """
    label, _, word = (part.strip() for part in text.partition("="))
    asked = {one["label"]: one for one in streams if one["candidates"]}
    if label not in asked:
        there = f"these do: {', '.join(sorted(asked))}" if asked else "no stream needs confirmation"
        raise StreamError(f"take: stream {label!r} needs no confirmation; {there}")
    if word == NONE:
        if asked[label]["required"]:
            raise StreamError(
                f"take: stream {label!r} is required and cannot be left out; start its program, "
                "or write required: false in the protocol"
            )
        return label, NOBODY
    candidates = [Candidate.read(each) for each in asked[label]["candidates"]]
    fitting = {one.identity for one in candidates if one.is_called(word)}
    if len(fitting) != 1:
        which = "; ".join(map(str, candidates))
        raise StreamError(
            f"take: {len(fitting)} streams for {label!r} are called {word!r}; write "
            f"{label}=SOURCE_ID, or its name, of one of them: {which}"
        )
    return label, fitting.pop()
