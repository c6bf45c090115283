"""What to write instead of a word that is not known."""

from collections.abc import Iterable


def suggestion(word: str, known: Iterable[str], otherwise: str = "there is") -> str:
    """Return the known word that is closest, as a question; all of them when none is close."""
    from difflib import get_close_matches  # noqa: PLC0415 - only a mistake needs it

    possible = list(known)
    if close := get_close_matches(word, possible, n=1):
        return f"did you mean {close[0]!r}?"
    return f"{otherwise} {', '.join(possible) or 'none'}"
