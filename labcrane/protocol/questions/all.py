"""All questions about a study."""

from collections.abc import Iterator

from labcrane.errors import suggestion
from labcrane.protocol.questions import (  # noqa: F401 - their questions are registered
    design,
    feedback,
    parts,
    sessions,
    streams,
    texts,
)
from labcrane.protocol.questions.parts import needs_people
from labcrane.protocol.questions.question import ASKED, REHEARSAL, CheckQuestion, key_of
from labcrane.protocol.study import Study


def questions(study: Study) -> tuple[CheckQuestion, ...]:
    """Return the warnings that need an answer before people take part."""
    found = list(dict.fromkeys(_asked(study)))  # of one place there may be several
    asked = {each.key for each in found}
    expected = study.protocol.expected
    stale = [
        CheckQuestion(
            f"expected.{at + 1}",
            ("expected", at),
            f"expected: {key!r} matches no warning; "
            f"{suggestion(key, asked, 'there is') if asked else 'remove it'}",
        )
        for at, key in enumerate(expected)
        if key not in asked and not key.startswith(REHEARSAL)
    ]
    return (*(each for each in found if each.key not in expected), *stale)


def _asked(study: Study) -> Iterator[CheckQuestion]:
    for asks in ASKED:
        for place, text in asks(study):
            yield CheckQuestion(key_of(place), place, f"{text}; is that meant?")
    yield from _of_the_operator(study)


def _of_the_operator(study: Study) -> Iterator[CheckQuestion]:
    """Question an operator that cannot replace the input: nothing can be simulated."""
    if needs_people(study.operator):
        yield CheckQuestion(
            "operator",
            ("operator", "use"),
            f"the operator, {study.operator.name!r}, is a device that a person moves, so the study "
            "can be neither simulated nor rehearsed; is that meant?",
        )
        return
    if lacks := dict.fromkeys(name for _, name in study.beyond_operator):
        place = ("operator",) if "operator" in study.written else study.beyond_operator[0][0]
        yield CheckQuestion(
            "operator",
            place,
            f"the operator, {study.operator.name!r}, which replaces the input in simulations, has "
            f"no {', '.join(lacks)}, so the study can be neither simulated nor rehearsed; is that "
            "meant?",
        )
