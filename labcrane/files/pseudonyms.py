"""Pseudonyms that match a study's pattern, for plans of participants who are yet to come."""

import itertools
import re

from labcrane.errors import ProtocolError
from labcrane.files.names import misfit

MOST = 100_000


def pseudonyms(pattern: str, count: int) -> list[str]:
    """Return the first ``count`` names of letters and a padded number that match ``pattern``.

    Raises
    ------
    ProtocolError
        The pattern is not of that kind.
    """
    written = re.sub(r"\\[A-Za-z]|\[[^]]*\]|\{[^}]*\}", " ", pattern)
    for letters in dict.fromkeys([*re.findall(r"[A-Za-z][A-Za-z_-]*", written), ""]):
        for digits in range(1, 7):
            numbers = range(1, min(MOST, 10**digits))
            candidates = (f"{letters}{number:0{digits}}" for number in numbers)
            names = (name for name in candidates if _fits(name, pattern))
            if len(found := list(itertools.islice(names, count))) == count:
                return found
    if count == 1 and _fits(pattern, pattern):
        return [pattern]  # of one person
    raise ProtocolError(
        f"no {count} names of letters and a number match participants.pattern {pattern!r}; take "
        "letters and then a number, as in 'P[0-9]{3}'"
    )


def _fits(name: str, pattern: str) -> bool:
    """Whether a name matches, and can be that of a participant's folder."""
    return bool(re.fullmatch(pattern, name)) and misfit(name) is None
