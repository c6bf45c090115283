"""A session beside the streams of others: the gate, a lost stream, a killed recorder."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from faults.sessions import journals, put_recorded, recorders, spares, talking, unique, wait_for

from labcrane import open_recording
from labcrane.recording.foreign_streams import read_streams

ROOT = Path(__file__).parents[1]
NEEDS = """\
streams:
  eeg: {{source_id: {source}, rate_hz: 100, channels: 2, counter: Counter}}
  gaze: {{source_id: {source}-gaze, required: false}}
  force: {{type: {source}-force, required: false}}
"""


RECORDERS, SPARES = 2, 2
RECORDER_KILLS = 4


class Sender:
    """A device whose first channel counts its samples."""

    def __init__(self, source: str, name: str = "Amplifier", kind: str = "EEG") -> None:
        self._arguments = [sys.executable, str(ROOT / "streams" / "emulation" / "sender.py")]
        self._arguments += [name, kind, source, "100"]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, first: int = 0) -> None:
        self._process = subprocess.Popen([*self._arguments, str(first)])

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


def all_receive(launcher: "subprocess.Popen[str]") -> bool:
    """Whether two recorders have what the device sent since it was started again."""
    found = [
        stream
        for recorder in recorders(launcher)
        for path in journals(recorder)
        for stream in read_streams([path])[0]
        if stream.header.name == "Amplifier" and (stream.data[:, 0] >= 100_000).any()
    ]
    return len(found) == RECORDERS


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """Run a session in which everything happens; yield its folder and what was printed."""
    folder = tmp_path_factory.mktemp("streams")
    source = unique("amplifier")
    sender = Sender(source)
    plates = [Sender(f"{source}-{each}", each, f"{source}-force") for each in ("Mine", "His")]
    put_recorded(folder, NEEDS.format(source=source), limit_s=30, input_lost="pause")
    process, said = talking(folder)
    try:
        said.until("is not on the network")
        for plate in plates:
            plate.start()
        said.until("; or 'Mine' (source_id")
        said.order("take force")
        said.until("2 streams for 'force'")
        said.order(f"take force={source}-Mine")
        said.until("stream force is 'Mine'")
        sender.start()
        said.until("space to start")
        said.order("start")
        said.until("Block 1 began")
        sender.kill()
        said.until("Stream eeg is lost")
        sender.start(first=100_000)
        said.until("Stream eeg is back")
        for kill in range(RECORDER_KILLS):
            wait_for(lambda: all_receive(process))
            recorders(process)[kill % 2].kill()
            said.until("a recorder died", times=kill + 1)
        wait_for(lambda: all_receive(process) and len(spares(process)) == SPARES)
        for recorder in recorders(process):
            recorder.kill()
        said.until("is lost", times=2)
        said.until(" is back", times=2)
        wait_for(lambda: all_receive(process))
        said.order("note all is well again")
        said.order("end")
        yield folder / "data" / "P001-PILOT" / "P001-PILOT.h5", said.end()
    finally:
        for each in (sender, *plates):
            each.kill()
        if process.poll() is None:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_session_waits_for_its_streams_and_says_for_which(session) -> None:
    _, said = session
    assert "waiting for streams:" in said
    waiting, started = said.index("is not on the network"), said.index("space to start")
    assert waiting < started


@pytest.mark.slow
def test_a_stream_of_a_type_is_the_one_that_somebody_confirmed_and_no_other_is_recorded(
    session,
) -> None:
    path, said = session
    recorded = open_recording(path).session(1)
    assert recorded.streams["Mine"].data.shape[0] > 0
    assert "His" not in recorded.streams
    (told,) = recorded.events["data"][recorded.events["name"] == "stream.confirmed"]
    assert (told["what"], told["by"]) == ("force", "terminal")
    assert told["which"].startswith("'Mine' (source_id '")
    assert "is requested by type" in said
    assert ", and was confirmed: it is 'Mine'" in said


@pytest.mark.slow
def test_a_lost_stream_pauses_the_session_until_it_is_back(session) -> None:
    path, _ = session
    events = open_recording(path).session(1).events
    names = [
        (name, data.get("what") or data.get("by"))
        for name, data in zip(events["name"], events["data"], strict=True)
        if name.split(".")[0] in {"stream", "pause"}
    ]
    lost = names.index(("stream.lost", "eeg"))
    back = names.index(("stream.back", "eeg"))
    assert ("pause.start", "eeg") in names[lost:back]
    assert names[back + 1] == ("pause.end", "eeg")
    assert ("stream.lost", "gaze") not in names  # it is not required


@pytest.mark.slow
def test_a_killed_recorder_costs_nothing_and_both_at_once_one_gap(session) -> None:
    path, _ = session
    assert len(list(path.parent.glob("ses-01_streams*.xdf"))) == RECORDERS + RECORDER_KILLS + 2
    stream = open_recording(path).session(1).streams["Amplifier"]
    counter = stream.data["Counter"].to_numpy()
    restarted = counter >= 100_000
    assert (np.diff(counter) > 0).all()  # each sample once, in order
    # The sender never stopped: what is missing in its count is the gap of both recorders.
    # How long it may be is tried where nothing else runs: tests/faults/test_kills.py.
    assert np.count_nonzero(np.diff(counter[restarted]) > 1) <= 1


@pytest.mark.slow
def test_the_gaps_and_what_to_do_are_in_the_sync_report(session) -> None:
    path, said = session
    report = open_recording(path).session(1).sync_report
    assert report["verdict"] == "FAIL"
    (amplifier,) = (one for one in report["streams"] if one["name"] == "Amplifier")
    assert amplifier["findings"]
    assert any("gaze was never on the network" in one["text"] for one in report["missing"])
    assert "sync report: FAIL" in said
