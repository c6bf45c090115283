"""Squares, sequences, slots: against known ones, closed forms and exhaustive counts."""

import itertools
import random
from collections import Counter

import pytest

from labcrane import ProtocolError
from labcrane.design.order import RULES, Turn
from labcrane.design.sampling import sequence
from labcrane.design.slots import group_of, next_slot, place_of
from labcrane.design.squares import carry_over, latin_square, positions, spread, williams

# Williams (1949) as crossdes::williams and Bradley (1958) print them, counted from 1.
KNOWN = {
    3: ["123", "231", "312", "321", "132", "213"],
    4: ["1243", "2314", "3421", "4132"],
    5: ["12534", "23145", "34251", "45312", "51423",
        "43521", "54132", "15243", "21354", "32415"],
    6: ["126354", "231465", "342516", "453621", "564132", "615243"],
    7: ["1273645", "2314756", "3425167", "4536271", "5647312", "6751423", "7162534",
        "5463721", "6574132", "7615243", "1726354", "2137465", "3241576", "4352617"],
    8: ["12837465", "23148576", "34251687", "45362718", "56473821", "67584132", "78615243",
        "81726354"],
}  # fmt: skip


@pytest.mark.parametrize("n", KNOWN)
def test_williams_squares_are_the_known_ones(n: int) -> None:
    rows = {"".join(str(item + 1) for item in row) for row in williams(n)}
    assert rows == set(KNOWN[n])


@pytest.mark.parametrize("n", range(2, 21))
def test_in_a_williams_square_everything_follows_everything_equally_often(n: int) -> None:
    rows = williams(n)
    assert len(rows) == (n if n % 2 == 0 else 2 * n)
    followed = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert followed == dict.fromkeys(itertools.permutations(range(n), 2), 1 if n % 2 == 0 else 2)
    placed = Counter((at, item) for row in rows for at, item in enumerate(row))
    assert set(placed.values()) == {len(rows) // n}


@pytest.mark.parametrize("n", range(1, 12))
def test_in_a_latin_square_everything_is_everywhere_once(n: int) -> None:
    rows = latin_square(n)
    assert all(sorted(row) == list(range(n)) for row in rows)
    assert all(sorted(column) == list(range(n)) for column in zip(*rows, strict=True))


def test_a_latin_square_is_not_balanced_for_carry_over_and_the_count_says_so() -> None:
    rows = [[str(item) for item in row] for row in latin_square(4)]
    assert spread(positions(rows), 16) == 0
    assert spread(carry_over(rows), 12) == 3  # 0 1 three times, 0 2 never


def runs(order) -> int:
    return max(len(list(run)) for _, run in itertools.groupby(order))


@pytest.mark.parametrize(("times", "most"), [(2, 1), (3, 1), (3, 2)])
def test_every_allowed_sequence_is_equally_likely_and_no_other_occurs(times, most) -> None:
    levels = ("a", "b") if times == 3 else ("a", "b", "c")
    all_orders = set(itertools.permutations(levels * times))
    allowed = {order for order in all_orders if runs(order) <= most}
    number = 200 * len(allowed)
    drawn = Counter(sequence(levels, times, most, seed) for seed in range(number))
    assert set(drawn) == allowed
    statistic = sum((count - 200) ** 2 / 200 for count in drawn.values())
    # Chi-square: far beyond its 0.999 quantile, which is below df + 4 sqrt(2 df) + 10.
    freedom = len(allowed) - 1
    assert statistic < freedom + 4 * (2 * freedom) ** 0.5 + 10


def test_the_hardest_sequences_are_found_at_once() -> None:
    order = sequence(("a", "b"), 40, 1, 5)
    assert order in {("a", "b") * 40, ("b", "a") * 40}


def test_a_sequence_that_cannot_be_is_refused() -> None:
    with pytest.raises(
        ProtocolError, match=r"1 levels, 3 times each, cannot be ordered with no more than 2"
    ):
        sequence(("a",), 3, 2, 1)


def test_blocked_levels_all_come_before_any_comes_again() -> None:
    levels = ("a", "b", "c")
    for seed in range(200):
        order = RULES["blocked"](levels, Turn(seed), 4, 1)
        assert all(sorted(order[at : at + 3]) == list(levels) for at in range(0, 12, 3))
        assert runs(order) == 1


def test_every_run_of_slots_holds_every_group_once() -> None:
    groups = ("none", "visual", "sound", "both")
    for run in range(50):
        slots = range(1 + 4 * run, 5 + 4 * run)
        assert sorted(group_of("study", groups, slot) for slot in slots) == sorted(groups)
        assert {place_of(groups, slot) for slot in slots} == {run}
    orders = {tuple(group_of("study", groups, 1 + 4 * r + k) for k in range(4)) for r in range(50)}
    assert len(orders) > 10  # not the same order again and again


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_a_thousand_enrolments_with_dropouts_keep_group_sizes_within_one(count: int) -> None:
    groups = tuple("abcde"[:count])
    chance = random.Random(count)
    taken: set[int] = set()
    for _ in range(1000):
        if taken and chance.random() < 0.35:
            taken.remove(chance.choice(sorted(taken)))
        taken.add(next_slot("study", groups, taken))
        sizes = Counter(dict.fromkeys(groups, 0))
        sizes.update(group_of("study", groups, slot) for slot in taken)
        assert max(sizes.values()) - min(sizes.values()) <= 1


def test_after_many_drop_out_at_once_the_smallest_group_is_filled_first() -> None:
    groups = ("a", "b", "c")
    taken = set(range(1, 31))
    taken -= {slot for slot in taken if group_of("study", groups, slot) == "b"}
    taken.remove(next(slot for slot in sorted(taken) if group_of("study", groups, slot) == "a"))
    for _ in range(9):
        slot = next_slot("study", groups, taken)
        assert group_of("study", groups, slot) == "b"
        taken.add(slot)


@pytest.mark.parametrize("seed", range(20))
def test_after_laboratories_were_merged_the_smallest_group_is_filled_first(seed: int) -> None:
    chance = random.Random(seed)
    groups = tuple("abcde"[: chance.randint(1, 5)])
    taken = [slot for _ in range(3) for slot in range(1, 1 + chance.randint(0, 14))]
    for _ in range(20):
        sizes = Counter(dict.fromkeys(groups, 0))
        sizes.update(group_of("study", groups, slot) for slot in taken)
        holes = set(range(1, max(taken, default=0))) - set(taken)
        slot = next_slot("study", groups, taken)
        assert slot not in taken
        assert slot in holes or sizes[group_of("study", groups, slot)] == min(sizes.values())
        taken.append(slot)


def test_long_sequences_are_drawn_without_a_call_for_every_trial() -> None:
    order = sequence(("a", "b"), 300, 2, 3)
    assert Counter(order) == {"a": 300, "b": 300}
    assert runs(order) == 2
