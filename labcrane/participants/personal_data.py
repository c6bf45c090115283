"""Finds in a text what could lead to a person."""

import re

_DOMAIN_END = re.compile(r"\.\w\w")
# Not telephone numbers, though they have many digits.
_HARMLESS = re.compile(
    r"\b\d{4}-\d\d-\d\d\b|\b\d{1,2}:\d\d(:\d\d)?\b|(?<![\d.])[-+]?\d+\.\d+(?![\d.])"
)
_DIGITS = re.compile(r"\+?\(?\d(?:[ ()/.\-]{0,2}\d)+")
PHONE_DIGITS = 7
"""Fewer digits than this are no telephone number that would lead to anybody."""


def personal(text: str) -> str | None:
    """Return what in ``text`` could lead to a person, in words; None if nothing was found.

    E-mail addresses and telephone numbers are found, names are not: a program cannot tell. The
    loop asks, so the time it takes grows as the text does, and no faster.
    """
    if "@" in text and any(map(_is_mail, text.split())):
        return "an e-mail address"
    for found in _DIGITS.findall(_HARMLESS.sub("|", text)):
        if sum(sign.isdigit() for sign in found) >= PHONE_DIGITS:
            return "a telephone number"
    return None


def _is_mail(word: str) -> bool:
    """Whether something stands before an @ and behind it, and then a dot and two letters.

    The first @ leaves the most behind it: no other needs to be tried.
    """
    at = word.find("@", 1)
    return at > 0 and _DOMAIN_END.search(word, at + 2) is not None
