"""Messages to a session: every one comes out as it went in, none is too large, nobody waits."""

import os
import pickle
import queue
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from labcrane.launcher import session_handle
from labcrane.launcher.session_handle import MOST_WAITING, SessionHandle
from labcrane.session.commands import (
    MOST_BYTES,
    EstimateFailed,
    FeedbackLost,
    FeedbackReady,
    LauncherGone,
    MessageError,
    StreamBack,
    StreamConfirmed,
    StreamLost,
    StreamOffered,
    decode,
    encode,
)
from labcrane.testing import Command, Order

# Names and reasons with colons, quotes and whatever else a text may hold.
WORDS = st.text(st.characters(exclude_categories=("Cs",)), max_size=200)
MESSAGES = st.one_of(
    st.builds(Command, st.sampled_from(Order), WORDS, WORDS),
    st.builds(StreamLost, WORDS),
    st.builds(StreamBack, WORDS),
    st.builds(StreamConfirmed, WORDS, WORDS, WORDS),
    st.builds(FeedbackLost, WORDS, WORDS, st.booleans(), st.integers(0, 9), st.integers(0, 9)),
    st.builds(FeedbackReady, WORDS, WORDS),
    st.builds(EstimateFailed, WORDS, WORDS),
    st.just(LauncherGone()),
    st.builds(StreamOffered, WORDS),
)


@given(MESSAGES)
def test_every_message_comes_out_of_the_pipe_as_it_went_in(message) -> None:
    assert decode(encode(message)) == message


@given(st.binary(max_size=300))
@example(b"{}")
def test_whatever_else_comes_out_of_the_pipe_is_no_message(line: bytes) -> None:
    with pytest.raises(
        MessageError, match=f"^{len(line)} bytes that are not a message to a session"
    ):
        decode(line)


def test_a_message_that_is_too_large_is_refused_by_whoever_says_it() -> None:
    with pytest.raises(
        MessageError, match=r"note: 20,000,\d+ bytes, but a session accepts at most 65,536"
    ):
        encode(Command(Order.NOTE, "x" * 20_000_000))
    largest = Command(Order.NOTE, "x" * (MOST_BYTES - 200))
    assert decode(encode(largest)) == largest


DEAF = "import time; time.sleep(600)"


def test_a_session_that_takes_nothing_keeps_nobody_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deaf_session.py").write_text(DEAF)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(session_handle, "MODULE", "deaf_session")
    said: queue.SimpleQueue[str] = queue.SimpleQueue()
    session = SessionHandle("nobody reads it", said.put)

    def talk() -> None:
        for _ in range(2 * MOST_WAITING):  # 60 kB each, more than any pipe takes
            session.send(Command(Order.NOTE, "x" * 60_000))

    talker = threading.Thread(target=talk, daemon=True)
    talker.start()
    talker.join(60.0)
    assert not talker.is_alive(), "whoever sends never waits for the session"
    assert said.get() == f"the session takes no messages; {MOST_WAITING} wait, and one was dropped"
    session.kill()
    assert session.ended
    assert session.close() == (-9 if os.name == "posix" else 1)


HALF = """
import os, sys
from labcrane.launcher.session_process import ParentConsole
from labcrane.processes.parent import Parent

console = ParentConsole(Parent())
taken = []
while not taken:
    taken += console.commands()
assert console.commands() == []  # it returns although half a message has come
os.write(2, b"coughed")
while len(taken) < 2:
    taken += console.commands()
print(taken, file=sys.stderr)
"""


def test_a_launcher_that_dies_in_the_middle_of_a_message_is_gone_and_nobody_waits() -> None:
    session = subprocess.Popen(
        [sys.executable, "-c", HALF],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    first = Command(Order.NOTE, "coughs")
    whole = pickle.dumps(encode(Command(Order.NOTE, "x" * 30_000)))
    session.stdin.write(pickle.dumps(encode(first)) + whole[:100])
    session.stdin.flush()
    assert session.stderr.read(len("coughed")) == b"coughed"
    session.stdin.close()
    *_, taken = session.stderr.read().decode().rpartition("coughed")
    session.stderr.close()
    assert session.wait() == 0
    assert taken.strip() == repr([first, LauncherGone()])
