"""Doors for what comes from outside, and how to break what goes through them.

Every door takes bytes. What is good at it stands in ``corpus/DOOR``, beside what was once found to
break it; a fuzzer changes that at random.
"""

import gc
import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import psutil

CORPUS = Path(__file__).with_name("corpus")
MOST_BYTES = 200_000_000
MOST_S, BUSY_S = 1.0, 20.0
"""Seconds of a thread for one input: where nothing else runs, and in tests beside others, whose
lines are counted; what an input could make grow without end passes neither."""

Enter = Callable[[bytes], object]


@dataclass
class Door:
    """Where something enters.

    Attributes
    ----------
    name
        Of its folder in the corpus.
    enter
        Lets bytes in; raises a documented error, or returns.
    refusals
        The errors that are documented.
    cheap
        How many times it is tried in the gate.
    words
        What may be put in at random: what means something there.
    """

    name: str
    enter: Enter
    refusals: tuple[type[Exception], ...]
    cheap: int
    words: tuple[bytes, ...] = ()
    found: dict[str, int] = field(default_factory=dict)

    def good(self) -> list[bytes]:
        return [path.read_bytes() for path in sorted((CORPUS / self.name).iterdir())]


EVERYWHERE = (
    b"", b"\0", b"\xff", b"\xed\xa0\x80", b"\xef\xbb\xbf", b"\xe2\x80\xae", b"NaN", b"1e999",
    b"-1", b"9" * 400, b"[" * 60, b"{" * 60, b"\n", b"\r\n", b'"', b"'", b"<", b"&", b",", b":",
)  # fmt: skip


def changed(good: bytes, dice: random.Random, words: tuple[bytes, ...]) -> bytes:
    """Return bytes changed at one to twelve places: flipped, cut, doubled, moved, put in."""
    data = bytearray(good)
    for _ in range(dice.choice([1, 1, 1, 2, 3, 5, 12])):
        at, long = dice.randrange(len(data) + 1), dice.choice([1, 1, 2, 4, 8, 32])
        match dice.randrange(7):
            case 0:
                data[at : at + 1] = bytes([dice.randrange(256)])
            case 1:
                del data[at : at + long]
            case 2:
                data[at:at] = data[at : at + long] * dice.choice([1, 2, 50])
            case 3:
                data[at : at + long] = dice.randbytes(long)
            case 4:
                data[at : at + dice.choice([0, long])] = dice.choice(words)
            case 5:
                other = dice.randrange(len(data) + 1)
                data[at:at] = data[other : other + long]
            case _:
                data = data[:at] if dice.random() < 0.1 else data
    return bytes(data)


def attack(door: Door, count: int, seed: int, most_s: float = BUSY_S) -> Mapping[str, int]:
    """Send changed bytes through a door; return how many were taken and refused.

    What takes longer than ``most_s``, or leaves the process 200 MB larger, is a failure; so is any
    error that is not documented. What breaks a door is named by seed and number.
    """
    dice, found = random.Random(seed), {"taken": 0, "refused": 0}
    good, words = door.good(), (*EVERYWHERE, *door.words)
    process = psutil.Process()
    gc.collect()
    before = process.memory_info().rss
    for number in range(count):
        given = changed(dice.choice(good), dice, words)
        began = time.thread_time()
        try:
            door.enter(given)
            found["taken"] += 1
        except door.refusals:
            found["refused"] += 1
        except Exception as error:
            error.add_note(f"{door.name}, seed {seed}, input {number}: {given[:300]!r}")
            raise
        took = time.thread_time() - began
        assert took < most_s, f"{door.name}, seed {seed}, input {number} took {took:.1f} s"
        if number % 50 == 0:
            grown = process.memory_info().rss - before
            assert grown < MOST_BYTES, f"{door.name}, seed {seed}, input {number}: {grown} bytes"
    return found
