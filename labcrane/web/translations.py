"""Translations of the pages' own wording into the participant's language."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from labcrane.core.items import Item
from labcrane.protocol.pages import Language


@dataclass(frozen=True, slots=True)
class Words:
    """One language.

    Attributes
    ----------
    takes
        Says what an item takes.
    refused
        Says why an answer, or what was handed in without one, was not taken; given the refusal in
        the record, and the item if it was one.
    seen, heard
        What stands on the button with which something is reported, and what is said once it has
        arrived; given what.
    """

    wait: str
    no_answer: str
    hand_in: str
    saved: str
    declined: str
    not_taken: str
    consent: str
    version: str
    take_part: str
    open_file: str
    takes: Callable[[Item], str]
    refused: Callable[[str, Item | None], str]
    seen: Callable[[str], str]
    heard: Callable[[str], str]


NAMES_GERMAN = {"deformity": "Verformung"}
"""Of what the bundled tasks ask about."""


def _takes_german(item: Item) -> str:
    if item.kind == "choice":
        return f"eines von {', '.join(item.labels or item.choices)}"
    if item.kind == "text":
        return "Worte"
    span = f"{item.lowest:g} bis {item.highest:g}"
    return f"{span} in Schritten von {item.step:g}" if item.step else span


def _refused_german(why: str, item: Item | None) -> str:
    del why  # it is in the record's language
    if item is None:
        return "Es fehlen noch Antworten: bitte antworten oder „Keine Angabe“ wählen"
    if item.kind == "text":
        return "Bitte ohne E-Mail-Adresse und Telefonnummer schreiben"
    return f"Möglich ist {_takes_german(item)}"


ENGLISH = Words(
    wait="Please wait. There is nothing to answer now.",
    no_answer="No answer",
    hand_in="Hand in",
    saved="saved",
    declined="declined",
    not_taken="not taken",
    consent="Consent",
    version="version",
    take_part="I have read this text and take part",
    open_file="Open",
    takes=lambda item: item.takes,
    refused=lambda why, item: why,
    seen=lambda what: f"I see: {what}",
    heard=lambda what: f"{what}: reported",
)

GERMAN = Words(
    wait="Bitte warten. Im Moment ist nichts zu beantworten.",
    no_answer="Keine Angabe",
    hand_in="Abgeben",
    saved="gespeichert",
    declined="ohne Angabe",
    not_taken="nicht angenommen",
    consent="Einwilligung",
    version="Fassung",
    take_part="Ich habe diesen Text gelesen und nehme teil",
    open_file="Öffnen:",
    takes=_takes_german,
    refused=_refused_german,
    seen=lambda what: f"Ich sehe: {NAMES_GERMAN.get(what, what)}",
    heard=lambda what: f"{NAMES_GERMAN.get(what, what)}: gemeldet",
)

WORDS: Mapping[Language, Words] = {"en": ENGLISH, "de": GERMAN}
