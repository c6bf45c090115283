"""Searches that wait as long as they are told, take few ports, and end with their process."""

import random
import subprocess
import sys
import time
from contextlib import closing

import pylsl
import pytest
from faults.sessions import unique, wait_for

from labcrane import StreamError
from labcrane.streams import NewestSample, newest, numeric_labels
from labcrane.streams.search import PORTS, equal, find, known_stream

SENDS = """
import sys, time, pylsl
info = pylsl.StreamInfo(sys.argv[1], "Test", 2, 100.0, "float32", sys.argv[1])
outlet = pylsl.StreamOutlet(info)
print("ready", flush=True)
while True:
    time.sleep(0.01)
    outlet.push_sample([float(sys.argv[2]), 1.0])
"""

LOSES = """
import subprocess, sys, threading, time
from labcrane.streams import NewestSample
from labcrane.streams.search import Search
import pylsl
stream, other = NewestSample({"name": sys.argv[1]}), Search()
assert stream.wait(240.0)
inlet = pylsl.StreamInlet(stream.info, recover=False)
print("ready", flush=True)
sys.stdin.readline()
time.sleep(float(sys.argv[2]))
"""

SEARCHES = """
import sys, time
import psutil
from labcrane.streams.network import port_range
from labcrane.streams.search import Search, equal
searches = [Search(equal(name=sys.argv[1])) for _ in range(4)]
most, ends = 0, time.monotonic() + 5.0
while not most or time.monotonic() < ends:
    held = psutil.Process().net_connections("udp")
    most = max(most, sum(one.laddr.port in port_range() for one in held))
    time.sleep(0.01)
for search in searches:
    search.close(patience_s=240.0)
print(most)
"""


def sender(name: str, value: float) -> "subprocess.Popen[str]":
    process = subprocess.Popen(
        [sys.executable, "-c", SENDS, name, str(value)], stdout=subprocess.PIPE, encoding="utf-8"
    )
    assert process.stdout.readline() == "ready\n"
    return process


def end(process: "subprocess.Popen[str]") -> None:
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_search_that_finds_nothing_waits_as_long_as_told_and_not_for_liblsl(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Told a multiple of liblsl's waves, its own search waits up to 5 s longer: it is not asked."""
    for name in ("resolve_streams", "resolve_byprop", "resolve_bypred"):
        monkeypatch.delattr(pylsl, name)
    draw = random.Random(7)
    for wait_s in (0.0, 0.5, *(draw.choice([0.1, 0.25, 0.4]) * draw.randint(1, 4) for _ in "abc")):
        began = time.monotonic()
        assert find(equal(name=unique("nobody")), wait_s) == []
        assert wait_s <= time.monotonic() - began


@pytest.mark.slow
def test_a_search_takes_the_ports_of_one_look_however_many_there_are() -> None:
    """In a process of its own: a look of another test's search may still be under way."""
    process = [sys.executable, "-c", SEARCHES, unique("nobody")]
    done = subprocess.run(process, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    most = int(done.stdout)
    assert 0 < most <= PORTS


def test_the_newest_sample_is_of_whoever_sends_now() -> None:
    name = unique("newest")
    first = sender(name, 1.0)
    with closing(NewestSample({"name": name})) as stream:
        assert stream.wait(240.0)
        wait_for(lambda: stream.newest() == [1.0, 1.0])
        end(first)
        second = sender(name, 2.0)
        wait_for(lambda: stream.newest() == [2.0, 1.0])
        end(second)


def test_a_stream_that_is_refused_says_why_and_is_not_received() -> None:
    def refuse(info: pylsl.StreamInfo) -> None:
        raise StreamError(f"it has {info.channel_count()}")

    name = unique("refused")
    process = sender(name, 1.0)
    with closing(NewestSample({"name": name}, refuse)) as it:
        wait_for(lambda: it.complaint == "it has 2")
        assert not it.connected
        assert it.newest() is None
    end(process)


def test_only_streams_of_numbers_have_labels_to_find_a_channel_by() -> None:
    numbers = pylsl.StreamInfo("panel", "Test", 2, 0.0, "float32")
    assert numeric_labels(numbers) == []
    numbers.set_channel_labels(["slew", "lift"])
    assert numeric_labels(numbers) == ["slew", "lift"]
    text = pylsl.StreamInfo("notes", "Test", 1, 0.0, "string")
    text.set_channel_labels(["note"])
    with pytest.raises(StreamError) as refusal:
        numeric_labels(text)
    assert str(refusal.value) == (
        "it has 1 channels of text, and 1 labels; send numbers, and a label for each channel"
    )


def test_a_stream_on_this_computer_is_received_by_its_description_without_a_search() -> None:
    name = unique("known")
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo(name, "Test", 1, 0.0, "float32", name))
    text = outlet.get_info().as_xml()
    info = known_stream(text)
    assert info is not None
    inlet = pylsl.StreamInlet(info, recover=False)
    inlet.open_stream(240.0)
    outlet.push_sample([7.0])
    assert inlet.pull_sample(240.0)[0] == [7.0]
    assert known_stream(text.replace(info.hostname(), "another-computer")) is None


def test_a_name_with_a_quote_is_searched_for_and_with_both_is_refused() -> None:
    assert equal(name="it's", type="EEG") == "name=\"it's\" and type='EEG'"
    with pytest.raises(StreamError, match="it holds both kinds of quotes; rename it"):
        equal(name='it\'s "so"')


@pytest.mark.slow
@pytest.mark.parametrize("number", range(6))
def test_a_process_that_loses_its_stream_ends_without_an_abort(number: int) -> None:
    """It ends while the stream is searched for again, at some moment of a look."""
    name = unique("lost")
    source = sender(name, 1.0)
    after = str(random.Random(number).uniform(0.0, 2.0))
    process = subprocess.Popen(
        [sys.executable, "-c", LOSES, name, after],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
    )
    assert process.stdout.readline() == "ready\n"
    end(source)
    _, said = process.communicate("now\n", timeout=240)
    assert process.returncode == 0, said
    assert "terminate" not in said


@pytest.mark.slow
def test_an_offered_stream_is_received_where_no_search_finds_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where liblsl's ports are used up, no stream answers a search."""
    name = unique("offered")
    gone, here = (
        pylsl.StreamOutlet(pylsl.StreamInfo(name, "Test", 1, 0.0, "double64", f"{name}-{which}"))
        for which in ("gone", "here")
    )
    newest.offer(gone.get_info().as_xml())
    del gone  # its process has died, and another one was started
    monkeypatch.setattr(newest.Search, "wait", lambda *_: [])
    with closing(NewestSample({"name": name})) as stream:
        assert not stream.wait(0.3)
        newest.offer(here.get_info().as_xml())
        assert stream.wait(10.0)
        here.push_sample([3.0])
        wait_for(lambda: stream.newest() == [3.0])
