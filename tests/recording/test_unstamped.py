"""Samples that came without a stamp have the sender's, or one worked back from the next chunk."""

import random

import numpy as np
import pytest

from labcrane.recording.unstamped import Received, stamped, unstamped


def sent(dice: random.Random, rate: float, began: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the true stamps of a device that sends chunks, and which of them are sent."""
    stamps, sends = [], []
    due = began
    for _ in range(dice.randrange(3, 30)):
        size = dice.randrange(1, 80)
        due += dice.uniform(0.0, 0.02)  # chunks are stamped when they are sent: they jitter
        stamps += [due + at / rate for at in range(size)]
        sends += [True] + [False] * (size - 1)
        due += size / rate
    return np.array(stamps), np.array(sends)


def received(stamps: np.ndarray, sends: np.ndarray, begin: int, end: int, rate: float) -> Received:
    """Return what a receiver of liblsl has that was connected from one sample to another."""
    last, found = 0.0, []
    for stamp, is_sent in zip(stamps[begin:end], sends[begin:end], strict=True):
        last = float(stamp) if is_sent else last + 1.0 / rate
        found.append(last)
    data = np.arange(begin, end, dtype=np.float64)[:, None] % 7.0
    return Received(np.array(found), data, [])


@pytest.mark.parametrize("seed", range(60))
def test_a_receiver_that_connects_within_a_chunk_has_the_stamps_of_one_that_was_there(
    seed: int,
) -> None:
    dice = random.Random(seed)
    rate = dice.choice([32.0, 250.0, 500.0, 512.0, 1000.0, 30_000.0])
    stamps, sends = sent(dice, rate, dice.uniform(100.0, 1e6))
    whole = received(stamps, sends, 0, len(stamps), rate)
    begin = dice.randrange(len(stamps) // 2)
    late = received(stamps, sends, begin, len(stamps), rate)
    rest = 0 if sends[begin] else int(np.argmax(sends[begin:]))
    assert unstamped(late.stamps, rate) == ([(0, rest)] if rest else [])
    found, estimated = stamped(late, rate, [whole])
    assert found.tobytes() == whole.stamps[begin:].tobytes()
    assert estimated == []


@pytest.mark.parametrize("seed", range(60))
def test_alone_they_are_a_period_apart_and_before_the_next_chunk(seed: int) -> None:
    dice = random.Random(1000 + seed)
    rate = dice.choice([32.0, 250.0, 512.0, 1000.0])
    stamps, sends = sent(dice, rate, dice.uniform(100.0, 1e6))
    begin = dice.choice(np.flatnonzero(~sends[: len(sends) // 2]).tolist() or [0])
    late = received(stamps, sends, begin, len(stamps), rate)
    found, estimated = stamped(late, rate, [])
    jitter = 0.02  # of the chunk behind them: no receiver can know it
    assert np.abs(found - stamps[begin:]).max() <= jitter + 1e-6
    rest = 0 if sends[begin] else int(np.argmax(sends[begin:]))
    assert estimated == ([(0, rest)] if rest else [])
    assert np.allclose(np.diff(found[: rest + 1]), 1.0 / rate, atol=1e-9)
    assert found[rest:].tobytes() == late.stamps[rest:].tobytes()


def test_after_a_connection_that_was_lost_it_is_the_same() -> None:
    stamps, sends = sent(random.Random(5), 250.0, 4000.0)
    (starts,) = np.nonzero(sends)
    again = next(int(at) + 1 for at in starts[2:] if not sends[at + 1])
    first = received(stamps, sends, 0, again - 3, 250.0)
    second = received(stamps, sends, again, len(stamps), 250.0)
    both = Received(
        np.r_[first.stamps, second.stamps], np.r_[first.data, second.data], []
    )  # fmt: skip
    ((begin, _),) = unstamped(both.stamps, 250.0)
    assert begin == again - 3
    found, ((estimated, _),) = stamped(both, 250.0, [])
    assert estimated == begin
    assert (np.diff(found) > 0.0).all()


@pytest.mark.parametrize("first", [0.0, 1 / 250.0])
def test_a_clock_that_began_at_zero_is_left_as_it_is(first: float) -> None:
    stamps = first + np.arange(2000) / 250.0
    stamps[700:] += 0.4  # and an interruption
    mine = Received(stamps, np.zeros((2000, 1)), [])
    found, estimated = stamped(mine, 250.0, [])
    assert found is stamps
    assert estimated == []


def test_markers_without_a_stamp_have_another_recorders_or_none() -> None:
    texts = [("a",), ("b",), ("c",)]
    mine = Received(np.array([0.0, 0.0, 77.5]), np.empty((3, 0)), texts)
    other = Received(np.array([70.0, 70.0, 70.0, 77.5]), np.empty((4, 0)), [("z",), *texts])
    found, estimated = stamped(mine, 0.0, [other])
    assert (found.tolist(), estimated) == ([70.0, 70.0, 77.5], [])
    found, estimated = stamped(mine, 0.0, [])
    assert (found.tolist(), estimated) == ([0.0, 0.0, 77.5], [])
