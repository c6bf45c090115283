"""Questions about how the YAML is written."""

from labcrane.protocol.questions.question import Doubts, asks, key_of
from labcrane.protocol.study import Study


@asks
def _of_commas(study: Study) -> Doubts:
    """Question lists of numbers in which a comma may be meant as the sign of a decimal."""
    for place, two in study.source.uneven_commas() if study.source else ():
        yield (
            place,
            (
                f"{key_of(place)} has {two} without a space beside commas with one, which are two "
                f"numbers; write {two.replace(',', '.')} if one is meant, or else "
                f"{two.replace(',', ', ')}"
            ),
        )


@asks
def _of_cut_texts(study: Study) -> Doubts:
    """Question texts that go on behind a space and a ``#``, which begins a comment."""
    for place, rest in study.source.cut_texts() if study.source else ():
        yield (
            place,
            (
                f"{key_of(place)} ends before {rest!r}, which YAML reads as a comment; put the "
                "text in quotation marks, or write the comment in a line of its own"
            ),
        )
