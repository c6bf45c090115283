"""Two recordings of one stream become one, without a duplicate and without a loss."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from labcrane.recording.overlap import sample_keys, union


def joined(first, second):
    found = union(np.array(first, np.uint64), np.array(second, np.uint64))
    out = np.full(found.size, -1, np.int64)
    for places, values in ((found.first, first), (found.second, second)):
        assert (np.diff(places) > 0).all()
        held = out[places]
        assert ((held == -1) | (held == values)).all()  # only equal samples share a place
        out[places] = values
    assert (out >= 0).all()
    return out.tolist()


spans = st.tuples(st.floats(0, 1), st.floats(0, 1)).map(sorted)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 400), spans, spans, st.integers(0, 2**32))
def test_parts_of_one_sequence_give_it_back(length, one, other, seed) -> None:
    """Of samples that are all different, what either lost anywhere is filled in from the other."""
    random = np.random.default_rng(seed)
    whole = random.permutation(10 * length)[:length].tolist()
    kept = [
        [whole[i] for i in range(int(a * length), int(b * length)) if random.random() > lost]
        for (a, b), lost in ((one, random.choice([0.0, 0.2])), (other, random.choice([0.0, 0.2])))
    ]
    out = joined(*kept)
    assert sorted(out) == sorted(set(kept[0]) | set(kept[1]))
    for part in kept:
        assert [each for each in out if each in set(part)] == part
    if max(map(len, kept)) and not (set(kept[0]) & set(kept[1])):
        assert out == kept[0] + kept[1]


@settings(max_examples=150, deadline=None)
@given(
    st.integers(1, 5),
    st.integers(1, 300),
    st.floats(0, 1),
    st.floats(0, 1),
    st.integers(0, 2**32),
)
def test_a_take_over_among_samples_that_repeat_loses_and_doubles_none(
    symbols, length, start, end, seed
) -> None:
    """The second begins within the first and outlives it; both have all there was meanwhile.

    What each of them has once is one sample: by others the two could be put together in two ways.
    """
    random = np.random.default_rng(seed)
    whole = random.integers(0, symbols, length).tolist()
    whole[int(start * length) : int(start * length) + 1] = [99]  # one sample of the overlap is rare
    a, b = int(start * length), int(start * length) + 1 + int(end * (length - start * length))
    first, second = whole[:b], whole[a:]
    once = [each for each in whole if first.count(each) == second.count(each) == 1]
    assume(all(first.index(each) - a == second.index(each) for each in once))
    assert joined(first, second) == whole


def test_equal_samples_are_known_by_every_bit_of_stamp_and_values() -> None:
    stamps = np.array([1.0, np.nextafter(1.0, 2.0), 1.0, 1.0])
    data = np.array([[0.0, np.nan], [0.0, np.nan], [-0.0, np.nan], [0.0, np.nan]])
    keys = sample_keys(stamps, data, [])
    assert keys[0] == keys[3]
    assert len(set(keys.tolist())) == 3
    texts = [("a", "b"), ("ab", ""), ("a", "b")]
    keys = sample_keys(np.ones(3), np.empty((0, 2)), texts)
    assert keys[0] == keys[2] != keys[1]


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float32", "float64", "int8", "int16", "int32", "int64"])
def test_keys_of_a_million_different_samples_differ(dtype) -> None:
    random = np.random.default_rng(5)
    data = random.integers(-100, 100, (10**6, 3)).astype(dtype)
    keys = sample_keys(np.arange(1e6) / 500.0, data, [])
    assert len(np.unique(keys)) == 10**6


@pytest.mark.parametrize("seed", range(20))
def test_what_one_recorder_alone_has_of_a_device_is_before_what_the_other_has_of_the_next(
    seed: int,
) -> None:
    """A device was killed and restarted: its last sample stood behind 22 of the new one."""
    random = np.random.default_rng(seed)
    old, new = int(random.integers(1, 50)), int(random.integers(10, 50))
    whole = np.arange(old + new)
    came = whole * 0.01 + 5.0 * (whole >= old)
    one = np.r_[whole[: old - int(random.integers(0, min(old, 4)))], whole[old:]]
    other = np.r_[whole[:old], whole[old + int(random.integers(0, 9)) :]]
    for first, second in ((one, other), (other, one)):
        found = union(first.astype(np.uint64), second.astype(np.uint64))
        found = found.as_they_came(came[first], came[second])
        out = np.full(found.size, -1)
        out[found.first], out[found.second] = first, second
        assert out.tolist() == whole.tolist()
