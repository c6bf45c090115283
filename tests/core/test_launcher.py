"""What people say before a session runs, and recorders that do not end as they should."""

import subprocess
import sys
from pathlib import Path

import pytest
from faults.sessions import STUDY, unique, wait_for

from labcrane import open_recording
from labcrane.launcher import launcher as launcher_module
from labcrane.launcher.launcher import Launcher
from labcrane.launcher.session_process import SessionConfig
from labcrane.session.commands import Command, Order, QueueConsole
from labcrane.streams.recorder import handle as recorder_keeper
from labcrane.streams.recorder.handle import RecorderHandle


class LateRecorder:
    """A recorder for whose streams everybody waits a while."""

    def __init__(self, *_: object) -> None:
        self.looks = 0
        self.status = {"ready": True}

    @property
    def ready(self) -> bool:
        return self.looks > 2

    def watch(self) -> bool:
        self.looks += 1
        return False

    def lost(self) -> set[str]:
        return set()

    def complaints(self) -> list[str]:
        return []

    def signals(self) -> dict[tuple[str, str, str], str]:
        return {}

    def unwatched(self) -> list[str]:
        return []

    def stop(self) -> None:
        pass


def test_a_note_that_is_given_while_streams_are_waited_for_is_in_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launcher_module, "RecorderHandle", LateRecorder)
    protocol = tmp_path / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("early")) + "streams: {eeg: {type: EEG}}\n")
    console, said = QueueConsole(), []
    for command in (
        Command(Order.NOTE, "the participant is nervous", "supervisor"),
        Command(Order.DENIED, "somebody asked for end", "page"),
        Command(Order.START),
    ):
        console.give(command)
    order = SessionConfig(protocol, "P001", 1, tmp_path / "data", simulated=True, feedback=False)
    assert Launcher(order, console, said.append).run().died is None
    session = open_recording(order.visit().folder.participant_file).session(1)
    events = session.events.set_index("name")["data"]
    assert events["order.note"]["text"] == "the participant is nervous"
    assert events["order.note"]["by"] == "supervisor"
    assert events["page.denied"]["why"] == "somebody asked for end"
    assert "order.start" not in events
    assert "start: the session has not begun; order it again when it has" in said


STOPS_BUT_HANGS_AS_A_SPARE = """
import sys, time
if not sys.stdin.readline():
    time.sleep(600)
print('{"ready": true}', flush=True)
open(sys.argv[1], "w").write(sys.stdin.readline())
"""


def test_a_spare_recorder_that_hangs_keeps_no_recorder_from_closing_its_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard, started = tmp_path / "heard", []

    class Stubborn(recorder_keeper._Recorder):
        def __init__(self) -> None:
            command = [sys.executable, "-c", STOPS_BUT_HANGS_AS_A_SPARE, str(heard)]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            subprocess.Popen.__init__(self, command, **pipes)
            started.append(self)

    monkeypatch.setattr(recorder_keeper, "_Recorder", Stubborn)
    keeper = RecorderHandle(tmp_path / "ses-01_streams.xdf", [])
    wait_for(lambda: keeper.ready, 60.0)
    monkeypatch.setattr(recorder_keeper, "PATIENCE_S", 3.0)
    keeper.stop()
    assert heard.read_text() == "stop\n"
    assert [process.returncode for process in started] == [0, -9]


def test_a_recorder_that_dies_as_it_is_given_its_orders_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Dying(recorder_keeper._Recorder):
        def __init__(self) -> None:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            subprocess.Popen.__init__(self, [sys.executable, "-c", ""], **pipes)
            self.wait()
            self.looks = 0

        def poll(self) -> int | None:
            self.looks += 1
            return super().poll() if self.looks > 1 else None  # alive when it is chosen

    monkeypatch.setattr(recorder_keeper, "_Recorder", Dying)
    keeper = RecorderHandle(tmp_path / "ses-01_streams.xdf", [])
    assert keeper.watch()
    assert keeper.restarts == 1
    keeper.stop()
