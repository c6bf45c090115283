"""Finds in a text what could lead to a person."""

import re

_MAIL = re.compile(r"\S+@\S+\.\w{2,}")
# Not telephone numbers, though they have many digits.
_HARMLESS = re.compile(
    r"\b\d{4}-\d\d-\d\d\b|\b\d{1,2}:\d\d(:\d\d)?\b|(?<![\d.])[-+]?\d+\.\d+(?![\d.])"
)
_DIGITS = re.compile(r"\+?\(?\d(?:[ ()/.\-]{0,2}\d)+")
PHONE_DIGITS = 7
"""Fewer digits than this are no telephone number that would lead to anybody."""


def personal(text: str) -> str | None:
    """Return what in ``text`` could lead to a person, in words; None if nothing was found.

    E-mail addresses and telephone numbers are found, names are not: a program cannot tell.
    """
    if _MAIL.search(text):
        return "an e-mail address"
    for found in _DIGITS.findall(_HARMLESS.sub("|", text)):
        if sum(sign.isdigit() for sign in found) >= PHONE_DIGITS:
            return "a telephone number"
    return None
