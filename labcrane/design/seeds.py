"""Seeds: all randomness of a study follows from its words, and can be derived again."""

import hashlib

SEED_BYTES = 6  # 48 bits: exact in a float64, which is what R, MATLAB and JSON keep numbers in


def derive(*words: str | int) -> int:
    """Return the seed that belongs to ``words``: study, participant, session, purpose.

    The first six bytes, big-endian, of the SHA-256 of the words joined by the unit separator.
    """
    text = "\x1f".join(str(word) for word in words)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:SEED_BYTES], "big")
