"""Messages to a session: every one comes out as it went in, none is too large, nobody waits."""

import multiprocessing
import os
import queue
import struct
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labcrane.launcher.launcher import MOST_WAITING, MessageSender
from labcrane.launcher.session_process import PipeConsole
from labcrane.session.commands import (
    MOST_BYTES,
    Command,
    FeedbackLost,
    FeedbackReady,
    LauncherGone,
    MessageError,
    Order,
    StreamBack,
    StreamLost,
    decode,
    encode,
)

# Names and reasons with colons, quotes and whatever else a text may hold.
WORDS = st.text(st.characters(exclude_categories=("Cs",)), max_size=200)
MESSAGES = st.one_of(
    st.builds(Command, st.sampled_from(Order), WORDS, WORDS),
    st.builds(StreamLost, WORDS),
    st.builds(StreamBack, WORDS),
    st.builds(FeedbackLost, WORDS, WORDS, st.booleans()),
    st.builds(FeedbackReady, WORDS, WORDS),
    st.just(LauncherGone()),
)


@given(MESSAGES)
def test_every_message_comes_out_of_the_pipe_as_it_went_in(message) -> None:
    assert decode(encode(message)) == message


@given(st.binary(max_size=300))
def test_whatever_else_comes_out_of_the_pipe_is_no_message(line: bytes) -> None:
    with pytest.raises(MessageError, match=f"^{len(line)} bytes that are no message to a session"):
        decode(line)


def test_a_message_that_is_too_large_is_refused_by_whoever_says_it() -> None:
    with pytest.raises(MessageError, match=r"note: 20,000,\d+ bytes, and a session takes 65,536"):
        encode(Command(Order.NOTE, "x" * 20_000_000))
    largest = Command(Order.NOTE, "x" * (MOST_BYTES - 200))
    assert decode(encode(largest)) == largest


def test_a_session_that_takes_nothing_keeps_nobody_waiting() -> None:
    ours, theirs = multiprocessing.Pipe()
    said: queue.SimpleQueue[str] = queue.SimpleQueue()
    sender = MessageSender(ours, said.put)

    def talk() -> None:
        for _ in range(2 * MOST_WAITING):  # 60 kB each, more than any pipe takes
            sender.send(Command(Order.NOTE, "x" * 60_000))

    talker = threading.Thread(target=talk, daemon=True)
    talker.start()
    talker.join(60.0)
    assert not talker.is_alive(), "whoever sends never waits for the session"
    assert said.get() == f"the session takes no messages; {MOST_WAITING} wait, and one was dropped"
    theirs.close()
    sender.close()
    ours.close()


def test_a_launcher_that_dies_in_the_middle_of_a_message_is_gone_and_nobody_waits() -> None:
    ours, theirs = multiprocessing.Pipe()
    console = PipeConsole(theirs)
    ours.send_bytes(encode(Command(Order.NOTE, "coughs")))
    whole = encode(Command(Order.NOTE, "x" * 30_000))
    os.write(ours.fileno(), struct.pack("!i", len(whole)) + whole[:100])
    taken = []
    while not taken:
        taken += console.commands()
    assert taken == [Command(Order.NOTE, "coughs")]
    assert console.commands() == []  # it returns although half a message has come
    ours.close()
    while len(taken) < 2:
        taken += console.commands()
    assert taken[1:] == [LauncherGone()]
    theirs.close()
