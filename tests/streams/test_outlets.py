"""The session's outlets, as another program sees them."""

import json
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from labcrane import Frame, StreamError, Tick
from labcrane.core import Event
from labcrane.core.events import CODES, KINDS, OTHER
from labcrane.machines import load_machine
from labcrane.recording.journal import event_text
from labcrane.streams.outlets import Outlets, check_clock
from labcrane.testing import make_frame, make_run

SOURCE = "study/P001/ses-01"
STREAMS = ("state", "input", "markers", "labels", "codes")


@pytest.fixture(scope="module")
def run():
    return make_run(load_machine("ch8"))


@pytest.fixture(scope="module")
def received(run):
    """What was sent, and what another process received."""
    outlets = Outlets(run, SOURCE)
    ids = [f"labcrane/{SOURCE}/labcrane.{name}" for name in STREAMS]
    counts = dict(zip(ids, (200, 200, 2, 2, 2), strict=True))
    arguments = [str(part) for pair in counts.items() for part in pair]
    command = [sys.executable, str(Path(__file__).with_name("consumer.py")), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8") as consumer:
        assert consumer.stdout.readline() == "ready\n"
        frames = list(a_few_frames(run, 200))
        for frame in frames:
            outlets.push(frame)
        heard = json.loads(consumer.stdout.readline())
    outlets.close()
    with pytest.raises(StreamError, match="closed"):
        outlets.push(frames[0])
    return frames, {name: heard[source] for name, source in zip(STREAMS, ids, strict=True)}


def a_few_frames(run, count):
    random = np.random.default_rng(1)
    start = time.perf_counter()
    for number in range(count):
        frame = make_frame(run, state=random.normal(size=run.state.size))
        frame.axes = random.uniform(-1, 1, run.axes.size)
        frame.tick = Tick(number, start + number / run.rate_hz, 0.0)
        if number == 50:
            frame.events = (Event("trial.start", frame.tick.due, {"trial": 3, "pair": "Aé"}),)
        if number == 150:
            odd = {"error": float("nan"), "depth": 1.5}
            frame.events = (Event("crane.wobble", frame.tick.due + 0.001, odd),)
        yield frame


def test_another_process_receives_the_state_and_input_bit_for_bit(received):
    frames, heard = received
    assert heard["state"]["samples"] == [frame.state.tolist() for frame in frames]
    assert heard["input"]["samples"] == [frame.axes.tolist() for frame in frames]


def test_frames_are_stamped_with_the_time_they_were_due(received):
    frames, heard = received
    assert heard["state"]["stamps"] == [frame.tick.due for frame in frames]
    assert heard["input"]["stamps"] == [frame.tick.due for frame in frames]


def test_markers_carry_the_event_and_the_time_it_happened(received):
    frames, heard = received
    first, second = (json.loads(sample[0]) for sample in heard["markers"]["samples"])
    assert first == {"event": "trial.start", "tick": 50, "trial": 3, "pair": "Aé"}
    assert second == {"event": "crane.wobble", "tick": 150, "error": None, "depth": 1.5}
    told = [event_text(e, f.tick.number) for f in frames for e in f.events]
    assert [text for (text,) in heard["markers"]["samples"]] == told  # as in the journal
    assert heard["markers"]["stamps"] == [frames[50].tick.due, frames[150].tick.due + 0.001]
    assert heard["codes"]["stamps"] == heard["markers"]["stamps"]
    assert heard["labels"]["stamps"] == heard["markers"]["stamps"]
    names = [label for (label,) in heard["labels"]["samples"]]
    assert names == ["trial_start/pair=Aé", "crane_wobble/pair=Aé"]


def test_codes_are_explained_in_their_streams_header(received):
    _, heard = received
    assert heard["codes"]["samples"] == [[CODES["trial.start"]], [OTHER]]
    table = {
        entry.findtext("event"): int(entry.findtext("value"))
        for entry in ET.fromstring(heard["codes"]["xml"]).iterfind("desc/codes/code")
    }
    assert table == {**CODES, "any other event": OTHER}
    assert len(set(table.values())) == len(table)


def test_labels_are_explained_in_their_streams_header(received):
    _, heard = received
    table = ET.fromstring(heard["labels"]["xml"]).findall("desc/labels/label")
    told = {entry.findtext("name"): entry.findtext("hed") for entry in table}
    assert told == {kind.label: kind.hed for kind in KINDS.values()}


def test_channels_say_what_they_are(received, run):
    _, heard = received
    state = ET.fromstring(heard["state"]["xml"])
    assert [c.findtext("label") for c in state.iterfind("desc/channels/channel")] == list(
        run.state.columns
    )
    assert state.findtext("type") == "MoCap"
    assert float(state.findtext("nominal_srate")) == run.rate_hz
    tip = [c for c in state.iterfind("desc/channels/channel") if c.findtext("object") == "tip"]
    types = [
        (c.findtext("type"), c.findtext("unit")) for c in tip if "position" in c.findtext("label")
    ]
    assert types == [("PositionX", "meters"), ("PositionY", "meters"), ("PositionZ", "meters")]
    axes = ET.fromstring(heard["input"]["xml"])
    assert axes.findtext("type") == "Joystick"
    assert [c.findtext("type") for c in axes.iterfind("desc/channels/channel")] == [
        "Axis", "Axis", "Button", "Axis", "Axis", "Button",
    ]  # fmt: skip


def test_liblsl_runs_on_the_clock_of_the_session():
    check_clock()


def test_an_outlet_never_lets_liblsl_choose_the_time(run):
    outlets = Outlets(run, "study/P002/ses-01")
    frame: Frame = make_frame(run)
    assert frame.tick.due == 0.0
    with pytest.raises(StreamError, match="cannot have the timestamp"):
        outlets.push(frame)
    outlets.close()
