"""The recorder process, with real sources that come, go, come back and misbehave."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pylsl
import pytest
import pyxdf
from streams.emulation import HERE, Lab, stop, until, until_ready

from labcrane import StreamError
from labcrane.recording.foreign_streams import read_streams
from labcrane.recording.paths import parts
from labcrane.recording.xdf.reader import read_xdf
from labcrane.streams.discovery import discover
from labcrane.streams.network import VARIABLE
from labcrane.streams.recorder.recorder import Recorder
from labcrane.streams.request import StreamRequest
from labcrane.streams.search import Search

EEG = {"label": "EEG", "type": "EEG", "several": True}
AMPLIFIER = {"label": "EEG", "type": "EEG", "name": "Amplifier"}
GAZE = {"label": "eyes", "name": "Gaze", "required": False, "rate_hz": 50, "channels": 3}


@pytest.fixture
def lab(tmp_path):
    lab = Lab(tmp_path, Path("not needed"))
    yield lab
    lab.close()


def named(status, name):
    return next(one for one in status["streams"] if one["name"] == name)


def events(stream):
    return [note.data["event"] for note in stream.notes]


@pytest.mark.slow
def test_streams_that_come_late_return_or_never_send_are_all_recorded(lab):
    first = lab.sender("Amplifier", "EEG", "amplifier-1")
    lab.sender("Mute", "EEG", "amplifier-2", rate=-100.0)
    recorder = lab.recorder(AMPLIFIER, EEG | {"label": "mute"}, GAZE)
    status = until_ready_but_for(recorder, "Mute")
    assert named(status, "Gaze")["condition"] == "absent"
    lab.sender("Gaze", "Gaze", "")
    status = until(recorder, lambda status: named(status, "Gaze")["samples"] > 0)
    text = " ".join(named(status, "Gaze")["warnings"])
    assert "has 2 channels; 3 are expected" in text
    assert "nominal rate of 100 Hz; 50 Hz are expected" in text
    assert "no source_id" in text or "made up by pylsl" in text
    first.kill()
    status = until(recorder, lambda status: named(status, "Amplifier")["condition"] == "silent")
    before = named(status, "Amplifier")["samples"]
    lab.sender("Amplifier", "EEG", "amplifier-1", first=1_000_000)
    until(recorder, lambda status: named(status, "Amplifier")["resets"] == 1)
    until(recorder, lambda status: named(status, "Amplifier")["samples"] > before + 10)
    until(recorder, lambda status: named(status, "Amplifier")["condition"] == "flows")
    assert stop(recorder) == 0

    streams = lab.streams()
    counts = streams["Amplifier"].data[:, 0]
    steps = np.diff(counts)
    assert np.count_nonzero(steps != 1.0) == 1  # the restart, and nothing else, is a break
    assert counts[-1] > 1_000_000
    assert events(streams["Amplifier"]) == ["opened", "silent", "reset", "flows"]
    assert len(streams["Mute"].time_raw) == 0
    assert "warning" in events(streams["Gaze"])
    assert streams["Amplifier"].header.channels[1].unit == "microvolts"
    loaded, _ = pyxdf.load_xdf(lab.journal)
    sizes = {one["info"]["name"][0]: len(one["time_stamps"]) for one in loaded}
    assert sizes["Amplifier"] == len(counts)


def until_ready_but_for(recorder, name):
    def holds(status):
        others = [s for s in status["streams"] if s["required"] and s["name"] != name]
        return (
            len(others) > 0
            and all(one["sane"] for one in others)
            and named(status, name)["condition"] == "empty"
        )

    status = until(recorder, holds)
    assert not status["ready"]
    assert any("no sample" in text for text in named(status, name)["warnings"])
    return status


@pytest.mark.slow
def test_the_recorder_outlives_whoever_started_it_by_a_grace_and_closes_its_journal(lab):
    lab.sender("Amplifier", "EEG", "amplifier-1")
    recorder = lab.recorder(AMPLIFIER, grace_s=1.5)
    until_ready(recorder)
    died = time.perf_counter()
    recorder.stdin.close()
    recorder.stdin = None
    recorder.stdout.read()
    assert recorder.wait(240) == 0
    assert read_xdf(lab.journal).whole
    after = lab.streams()["Amplifier"].time_raw[-1] - died
    assert after > 0.0, "it went on recording when nobody was there any more"


@pytest.mark.slow
def test_a_killed_recorder_goes_on_in_the_next_part(lab):
    lab.sender("Amplifier", "EEG", "amplifier-1")
    first = lab.recorder(AMPLIFIER)
    kept = named(until_ready(first), "Amplifier")["samples"]
    first.kill()
    first.wait()
    died = time.perf_counter()
    second = lab.recorder(AMPLIFIER)
    until_ready(second)
    assert stop(second) == 0
    assert [part.name for part in parts(lab.journal)] == [
        "ses-01_streams.xdf",
        "ses-01_streams.part2.xdf",
    ]
    stream = lab.streams()["Amplifier"]
    before, after = np.split(stream.time_raw, [stream.starts[1]])
    assert len(before) >= kept
    assert before[-1] < died < after[0]
    assert len(after) > 0
    assert (np.diff(stream.data[:, 0])[: len(before) - 1] == 1.0).all()
    assert events(stream) == ["opened", "opened"]


def test_samples_of_a_chunk_under_way_when_the_recorder_connects_have_the_times_they_are_of(lab):
    lab.start(str(HERE / "halfway.py"), "Amplifier", "amplifier-1")
    recorder = lab.recorder(AMPLIFIER)
    until(recorder, lambda status: named(status, "Amplifier")["samples"] > 64)
    assert stop(recorder) == 0
    (came,) = (
        each.stamps for each in read_xdf(lab.journal).streams if each.header.name == "Amplifier"
    )
    assert came[:3].tolist() == pytest.approx([0.004, 0.008, 0.012], abs=1e-9), "as liblsl has them"
    stream = lab.streams()["Amplifier"]
    assert stream.data[0, 0] == 5
    assert stream.time_raw == pytest.approx(stream.data[:, 1], abs=1e-8)
    (note,) = (note.data for note in stream.notes if note.data["event"] == "unstamped")
    assert note["samples"] == [0, 11]


@pytest.mark.slow
def test_two_programs_with_one_source_id_are_warned_of(lab):
    lab.sender("Amplifier", "EEG", "same")
    lab.sender("Amplifier", "EEG", "same")
    recorder = lab.recorder(AMPLIFIER)
    status = until(recorder, lambda s: "2 programs" in " ".join(s["streams"][0]["warnings"]))
    assert "'same'" in " ".join(status["streams"][0]["warnings"])
    looks = ([one for one in discover(1.0) if one.name == "Amplifier"] for _ in range(100))
    found = next(both for both in looks if len(both) > 1)  # both answer sooner or later
    assert "2 programs" in found[0].warnings[-1]
    assert stop(recorder) == 0
    assert events(lab.streams()["Amplifier"]) == ["opened", "warning"]


@pytest.mark.slow
def test_a_source_of_another_lsl_session_is_not_taken_for_one_that_is_gone(
    lab, tmp_path, monkeypatch
):
    """Two laboratories have one network, and amplifiers of one source_id."""
    ours = Path(os.environ[VARIABLE])
    theirs = tmp_path / "theirs.cfg"
    lines = (line for line in ours.read_text("utf-8").splitlines() if "SessionID" not in line)
    theirs.write_text("\n".join(lines), encoding="utf-8")
    first = lab.sender("Amplifier", "EEG", "amplifier-1")
    recorder = lab.recorder(AMPLIFIER)
    until_ready(recorder)
    first.kill()
    with monkeypatch.context() as patch:
        patch.setenv(VARIABLE, str(theirs))
        lab.sender("Amplifier", "EEG", "amplifier-1", first=5_000_000)
    until(recorder, lambda status: (status["streams"][0]["silent_s"] or 0.0) > 5.0)
    lab.sender("Amplifier", "EEG", "amplifier-1", first=1_000_000)
    until(recorder, lambda status: status["streams"][0]["resets"] == 1)
    until_ready(recorder)
    assert stop(recorder) == 0
    counts = lab.streams()["Amplifier"].data[:, 0]
    assert 1_000_000 <= counts.max() < 5_000_000


def test_a_source_that_no_search_finds_goes_on_being_recorded_when_its_parent_tells(
    tmp_path, monkeypatch
):
    """A view is killed and started again while all of the ports that LSL asks are taken."""
    monkeypatch.setattr(Search, "results", lambda _: [])
    journal = tmp_path / "ses-01_streams.xdf"
    recorder = Recorder(journal, [StreamRequest("view", name="View")])
    for first, label in ((0, "shown"), (20, "seen")):
        described = pylsl.StreamInfo("View", "Frames", 1, 0.0, "double64", f"view-{os.getpid()}")
        channel = described.desc().append_child("channels").append_child("channel")
        channel.append_child_value("label", label)
        outlet = pylsl.StreamOutlet(described)
        recorder.know([outlet.get_info().as_xml()])
        assert outlet.wait_for_consumers(60.0)
        for count in range(first, first + 20):
            outlet.push_sample([float(count)])
        deadline = time.monotonic() + 60.0
        while recorder.health()[0].samples < first + 20:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        del outlet
    (health,) = recorder.health()
    assert recorder.close()
    (stream,) = (each for each in read_streams(parts(journal))[0] if each.header.name == "View")
    assert stream.data[:, 0].tolist() == [*range(40)]
    (reset,) = (note.data for note in stream.notes if note.data["event"] == "reset")
    assert reset["samples"] == [20, 20]
    assert "check the montage, ('seen',) now" in " ".join(health.warnings)


@pytest.mark.slow
def test_a_source_that_comes_back_in_this_session_is_not_warned_of(lab):
    first = lab.sender("Amplifier", "EEG", "amplifier-1")
    recorder = lab.recorder(AMPLIFIER)
    until_ready(recorder)
    first.kill()
    until(recorder, lambda status: status["streams"][0]["condition"] == "silent")
    lab.sender("Amplifier", "EEG", "amplifier-1")
    status = until(recorder, lambda status: status["streams"][0]["resets"] == 1)
    before = status["streams"][0]["samples"]
    until(recorder, lambda status: status["streams"][0]["samples"] > before + 1000)
    assert stop(recorder) == 0
    assert "warning" not in events(lab.streams()["Amplifier"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ({"channels": 5}, "5 channels instead of 2"),
        ({"form": "double64"}, "another format of its samples"),
    ],
)
def test_a_source_that_comes_back_in_another_shape_is_recorded_as_a_new_stream(lab, shape, said):
    """Nothing of a device with another montage was recorded any more, without a word."""
    first = lab.sender("Amplifier", "EEG", "amplifier-1")
    recorder = lab.recorder(AMPLIFIER)
    until_ready(recorder)
    first.kill()
    first.wait()
    until(recorder, lambda status: status["streams"][0]["condition"] == "silent")
    lab.sender("Amplifier", "EEG", "amplifier-1", first=1_000_000, **shape)
    until(recorder, lambda status: not status["ready"])
    status = until(recorder, lambda status: status["ready"] and len(status["streams"]) == 2)
    before, now = status["streams"]
    assert not before["required"]
    assert now["condition"] == "flows"
    for one in (before, now):
        assert f"came back with {said}" in " ".join(one["warnings"])
    assert stop(recorder) == 0
    recorded, _ = read_streams(parts(lab.journal))
    counts = [stream.data[:, 0] for stream in recorded]
    assert [len(stream.header.channels) for stream in recorded] == [2, shape.get("channels", 2)]
    assert counts[0][-1] < 1_000_000 <= counts[1][0]
    assert (np.diff(counts[1]) == 1.0).all()


def test_a_required_stream_that_is_not_what_was_expected_holds_the_session_back(lab):
    lab.sender("Amplifier", "EEG", "amplifier-1", rate=200.0)
    recorder = lab.recorder(EEG | {"channels": 64})
    status = until(recorder, lambda status: named_or_none(status, "Amplifier") == "flows")
    assert not status["ready"]
    assert status["streams"][0]["misfits"] == ["has 2 channels; 64 are expected"]
    assert stop(recorder) == 0


def named_or_none(status, name):
    return next((s["condition"] for s in status["streams"] if s["name"] == name), None)


@pytest.mark.slow
def test_discovery_tells_rate_units_and_clock(lab):
    lab.sender("Amplifier", "EEG", "amplifier-1")
    deadline = time.monotonic() + 240.0
    while not (found := [one for one in discover(0.5) if one.name == "Amplifier"]):
        assert time.monotonic() < deadline
    (one,) = found
    assert (one.type, one.rate_hz, one.channels, one.format) == ("EEG", 100.0, 2, "float32")
    assert one.units == ("1", "microvolts")
    assert one.rtt_s > 0.0
    assert abs(one.offset_s) <= one.rtt_s / 2  # both are on this computer's clock
    assert one.warnings == ()


def test_a_recorder_that_is_told_nonsense_says_what_it_understands():
    orders = json.dumps({"journal": "x.xdf", "streams": [], "colour": "red"})
    done = subprocess.run(
        [sys.executable, "-m", "labcrane.streams.recorder.process", orders],
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert "has no setting colour" in done.stderr


def test_a_request_that_any_stream_would_meet_is_refused():
    with pytest.raises(StreamError, match="give its type, name or source_id"):
        StreamRequest("anything")


@pytest.mark.slow
def test_a_request_that_two_streams_meet_takes_none_silently(lab):
    """Two programs of one name; both are recorded, the session waits."""
    for source_id in ("amplifier-1", "filter-1"):
        lab.sender("Amplifier", "EEG", source_id)
    recorder = lab.recorder(AMPLIFIER)
    status = until(recorder, lambda status: len(status["streams"]) == 2)
    status = until(recorder, lambda status: all(one["samples"] for one in status["streams"]))
    assert not status["ready"]
    for one in status["streams"]:
        (text,) = one["misfits"]
        assert "so do 2 streams: 'Amplifier' (amplifier-1), 'Amplifier' (filter-1)" in text
        assert "give the name or source_id of the right one, or several: true" in text
    assert stop(recorder) == 0
    recorded, _ = read_streams(parts(lab.journal))
    assert {stream.header.source_id for stream in recorded} == {"amplifier-1", "filter-1"}
    for stream in recorded:  # and noted once beside both
        noted = [note.data["text"] for note in stream.notes if "text" in note.data]
        (text,) = [text for text in noted if "so do 2 streams" in text]
        assert "(amplifier-1)" in text
        assert "(filter-1)" in text
