"""Pseudonyms that match a study's pattern, for plans of participants who are yet to come."""

import itertools
import re

from labcrane.errors import ProtocolError

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
            names = (name for name in candidates if re.fullmatch(pattern, name))
            if len(found := list(itertools.islice(names, count))) == count:
                return found
    if count == 1 and re.fullmatch(pattern, pattern):
        return [pattern]  # of one person
    raise ProtocolError(
        f"no {count} names of letters and a number match the pattern {pattern!r}; "
        "name participants with --participant"
    )
