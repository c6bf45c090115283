"""Pseudonyms in texts and paths: whole words only, in every spelling that exports use."""

import re
from collections.abc import Iterable

from labcrane.files.names import STAMPS

LETTER = r"[A-Za-z0-9]"

LABELS = ("sub-", "subject-")
"""Prefixes of a pseudonym in BIDS and in Psych-DS."""


def spellings(name: str) -> list[str]:
    """Return the forms of a pseudonym: unchanged, and as BIDS and Psych-DS require it.

    Those take letters and digits only: ``VP-001-PILOT`` is ``VP001PILOT`` there.
    """
    bare = re.sub(r"[^A-Za-z0-9]", "", name)
    pilot, simulated = STAMPS
    ends = ("", pilot, simulated, f"{pilot}{simulated}")
    return list(dict.fromkeys([name, *(f"{bare}{end}" for end in ends)]))


class Mentions:
    """Finds the participants whose pseudonyms a text contains.

    A word that fits two pseudonyms belongs to the longer one. A pseudonym without a letter looks
    like a number, and is found only where it is the whole text or follows ``sub-``.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._owners = {word: name for name in names for word in spellings(name) if word}
        self._pattern = _pattern(list(self._owners))
        self._letters = _letters(list(self._owners))

    def of(self, text: str, start: int = 0, stop: int | None = None) -> set[str]:
        """Return whose pseudonyms begin in ``text`` between two of its places.

        The text around a word decides whether it is a name. A longer text is therefore
        read in chunks, each with some text before and after it.
        """
        # What begins with a look behind is tried at every sign, and files have many millions; the
        # letters alone are searched for as fast as memory is read.
        end = len(text) if stop is None else stop
        found: set[str] = set()
        at = self._letters.search(text)
        while at is not None and at.start() < end:
            match = self._pattern.match(text, at.start())
            if match and at.start() >= start:
                found.add(self._owners[match[0]])
            at = self._letters.search(text, match.end() if match else at.start() + 1)
        return found

    def renamed(self, text: str, old: str, new: str) -> str:
        """Return ``text`` with ``new`` where ``old`` was, each in the same spelling.

        A name that is all letters and digits is its own spelling in BIDS and Psych-DS; it is taken
        for that where they put it, behind ``sub-`` and ``subject-``.
        """
        words = dict(reversed([*zip(_all_spellings(old), _all_spellings(new), strict=True)]))
        bare = _all_spellings(new)[1]

        def put(match: re.Match[str]) -> str:
            word = match[0]
            if self._owners[word] != old:
                return word
            return bare if word == old and text[: match.start()].endswith(LABELS) else words[word]

        return self._pattern.sub(put, text)


def _all_spellings(name: str) -> list[str]:
    bare = re.sub(r"[^A-Za-z0-9]", "", name)
    pilot, simulated = STAMPS
    return [name, *(f"{bare}{end}" for end in ("", pilot, simulated, f"{pilot}{simulated}"))]


def _letters(words: list[str]) -> re.Pattern[str]:
    """Return a pattern that finds the beginning of every word in any surroundings."""
    return re.compile("|".join(re.escape(word) for word in words) or r"(?!)")


def _pattern(words: list[str]) -> re.Pattern[str]:
    words = sorted(words, key=len, reverse=True)
    named = "|".join(re.escape(word) for word in words if re.search("[A-Za-z]", word))
    numbers = "|".join(re.escape(word) for word in words if not re.search("[A-Za-z]", word))
    parts = []
    if named:
        parts.append(rf"(?<!{LETTER})(?:{named})(?!{LETTER})")
    if numbers:
        parts.append(rf"(?:(?<=\Asub-)|(?<=/sub-)|(?<=/)|(?<![\s\S]))(?:{numbers})(?![^_/.])")
    return re.compile("|".join(parts) or r"(?!)")
