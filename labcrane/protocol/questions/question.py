"""A question of ``check``: a setting that is allowed, but probably a mistake.

Each has a key. A protocol that lists the key under ``expected:`` gets no such warning again.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from labcrane.errors import LabcraneError
from labcrane.files.yaml import Place
from labcrane.protocol.steps import Block
from labcrane.protocol.study import Study

_AT = re.compile(r"(.+?):(\d+)(?::(\d+))?: (.*)")

REHEARSAL = "rehearsal."
"""Keys of questions that only a rehearsal asks begin with this."""


@dataclass(frozen=True, slots=True)
class CheckQuestion:
    """A warning: the protocol can be run, but contains what is probably a mistake.

    Attributes
    ----------
    key
        The key that answers it under ``expected:``: ``tasks.aiming.limit_s``.
    place
        Where it is in the protocol.
    text
        The warning, with numbers and units.
    """

    key: str
    place: Place
    text: str

    @property
    def whole(self) -> str:
        """The warning, and how to answer it."""
        return f"{self.text} (if it is, write expected: [{self.key}])"


Doubts = Iterator[tuple[Place, str]]
"""Places in a protocol, and what is doubtful there."""

ASKED: list[Callable[[Study], Doubts]] = []
"""Every question, in the order in which they are asked."""


def asks(question: Callable[[Study], Doubts]) -> Callable[[Study], Doubts]:
    """Register a question."""
    ASKED.append(question)
    return question


def key_of(place: Sequence[str | int]) -> str:
    """Return the key of a question about a place; items count from 1."""
    return ".".join(str(step + 1) if isinstance(step, int) else step for step in place)


def blocks_in(study: Study) -> Iterator[tuple[Place, Block]]:
    """Yield where each step with trials is, and its keys."""
    for number, session in enumerate(study.protocol.sessions):
        for at, step in enumerate(session.steps):
            if step.block is not None:
                yield ("sessions", number, "steps", at), step.block


def steps_in(study: Study) -> Iterator[tuple[Place, str, Block]]:
    """Yield where each block, practice and reference is, which it is, and its keys."""
    for place, block in blocks_in(study):
        kind = study.protocol.sessions[int(place[1])].steps[int(place[3])].kind
        yield (*place, kind), kind, block


Finding = dict[str, Any]
"""One finding of a check, for programs: kind, file, line, column, key, text, the text with the way
to answer a warning, and all of it in one line for people."""


def about(study: Study, question: CheckQuestion) -> Finding:
    """Return the finding of a warning."""
    line, column = study.source.position(question.place) if study.source else (1, 1)
    return {
        "kind": "question",
        "file": str(study.path),
        "line": line,
        "column": column,
        "key": question.key,
        "text": question.text,
        "message": question.whole,
        "whole": f"{study.path}:{line}:{column}: warning: {question.whole}",
    }


def problems(error: LabcraneError) -> list[Finding]:
    """Return a finding for every mistake in an error, which has one a line."""
    found = []
    for whole in str(error).splitlines():
        at = _AT.match(whole)
        file, line, column, text = at.groups() if at else ("", None, None, whole)
        found.append(
            {
                "kind": "problem",
                "file": file,
                "line": int(line or 1),
                "column": int(column or 0),
                "key": "",
                "text": text,
                "message": text,
                "whole": whole,
            }
        )
    return found
