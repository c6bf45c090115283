"""A channel goes bad in a session: people are told, and its trials are flagged in the file."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from faults.sessions import put_recorded, talking, unique, wait_for
from own_modules import OWN_MODULES

from labcrane import open_recording

TESTS = Path(__file__).parents[1]
NEEDS = """\
streams:
  eeg: {{source_id: {source}}}
monitors:
  electrodes: {{use: eeg_signal, mains_hz: 50}}
"""


class Head:
    """An amplifier with a person's EEG, whose channels can be made flat."""

    def __init__(self, source: str) -> None:
        program = str(TESTS / "streams" / "emulation" / "head.py")
        self.process = subprocess.Popen(
            [sys.executable, program, source],
            stdin=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": OWN_MODULES},
        )

    def make(self, what: str, column: int) -> None:
        self.process.stdin.write(f"{what} {column}\n")
        self.process.stdin.flush()

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """Run a session in which a channel is flat for a while; yield its file and what was said."""
    folder = tmp_path_factory.mktemp("signals")
    source = unique("head")
    put_recorded(folder, NEEDS.format(source=source), limit_s=60)
    head = Head(source)
    process, said = talking(folder)
    try:
        said.until("space to start")
        said.order("start")
        said.until("Block 1 began")
        head.make("flat", 3)
        said.until("eeg E3: flat line: ")
        head.make("live", 3)
        said.until("eeg E3: flat line no more")
        said.order("end")
        said.end()
        path = folder / "data" / "P001-PILOT" / "P001-PILOT.h5"
        wait_for(path.exists)
        yield path, "\n".join(said.said)
    finally:
        head.end()
        if process.poll() is None:
            process.kill()
            process.wait()


@pytest.mark.long
def test_an_event_says_when_a_channel_goes_bad_and_when_it_recovers(session) -> None:
    path, _ = session
    events = open_recording(path).session(1).events
    told = [
        (name, data["stream"], data["channel"], data["kind"])
        for name, data in zip(events["name"], events["data"], strict=True)
        if name.startswith("signal.")
    ]
    assert told == [
        ("signal.bad", "eeg", "E3", "flat line"),
        ("signal.good", "eeg", "E3", "flat line"),
    ]


@pytest.mark.long
def test_the_trial_is_flagged_in_the_participant_file(session) -> None:
    path, _ = session
    record = open_recording(path).session(1)
    (fault,) = record.signal_faults.itertuples()
    assert (fault.stream, fault.channel, fault.kind) == ("Amplifier", "E3", "flat line")
    events = record.events.set_index("name")
    assert fault.start < events.loc["signal.bad", "time"] < fault.end, "it is told while it lasts"
    flagged = record.trial_signal_faults
    assert set(flagged["trial"]) == {1.0}
    assert set(flagged["channel"]) == {"E3"}
    assert flagged["seconds"].iloc[0] > 0.0
