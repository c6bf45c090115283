"""Orders and seeds."""

import hashlib
from collections import Counter

from labcrane.design.order import RULES, Turn, shuffled
from labcrane.design.seeds import derive
from labcrane.protocol.design import RULES as WORDS

LEVELS = ("a", "b", "c", "d")


def test_a_seed_is_the_start_of_a_sha256() -> None:
    digest = hashlib.sha256(b"aiming\x1fP001\x1f1").hexdigest()
    assert derive("aiming", "P001", 1) == int(digest[:12], 16)


def test_what_a_protocol_may_say_of_an_order_is_what_can_be_followed() -> None:
    assert sorted(RULES) == [*WORDS]


def test_seeds_are_exact_in_a_float64() -> None:
    assert all(int(float(seed)) == seed for seed in (derive("x", n) for n in range(1000)))


def test_words_cannot_run_into_one_another() -> None:
    assert derive("ab", "c") != derive("a", "bc")


def test_as_written_changes_nothing() -> None:
    assert RULES["as_written"](LEVELS, Turn(5), 1, None) == LEVELS


def test_shuffled_is_a_permutation_that_follows_from_the_seed() -> None:
    assert sorted(shuffled(LEVELS, 5)) == list(LEVELS)
    assert shuffled(LEVELS, 5) == shuffled(LEVELS, 5)


def test_every_order_is_equally_likely() -> None:
    counts = Counter(shuffled(LEVELS, derive("study", number)) for number in range(24_000))
    assert len(counts) == 24
    # Chi-square with 23 degrees of freedom exceeds 49.73 with probability 0.001.
    assert sum((count - 1000) ** 2 / 1000 for count in counts.values()) < 49.73
