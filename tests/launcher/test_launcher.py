"""What people say before a session runs, and recorders that hang or do not end in order."""

import os
import threading
from pathlib import Path

import psutil
import pytest
from faults.sessions import STUDY, unique, wait_for

from labcrane import open_recording
from labcrane.launcher import launcher as launcher_module
from labcrane.launcher.launcher import Launcher
from labcrane.session.commands import StreamConfirmed
from labcrane.session.visit import visit_of
from labcrane.streams.recorder import handle as recorder_handle
from labcrane.streams.recorder.candidates import answered
from labcrane.streams.recorder.handle import RecorderHandle
from labcrane.testing import Command, Order, QueueConsole


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

    asks = False

    def taken(self) -> list[str]:
        return ["eeg: is requested by type 'EEG' only, and was confirmed"]

    def stop(self) -> None:
        pass


def a_launcher(
    folder: Path, needs: str = "", **how: bool
) -> tuple[Launcher, QueueConsole, list[str]]:
    """Return the launcher of a study with further lines, its console, and what it says."""
    (folder / "study.yaml").write_text(
        STUDY.format(study=unique("launched")) + needs, encoding="utf-8"
    )
    console, said = QueueConsole(), []
    visit = visit_of(folder / "study.yaml", "P001", 1, folder / "data", feedback=False, **how)
    return Launcher(visit, console, said.append), console, said


EEG = "streams: {eeg: {type: EEG}}\n"


@pytest.mark.slow
def test_a_note_that_is_given_while_streams_are_waited_for_is_in_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launcher_module, "RecorderHandle", LateRecorder)
    launcher, console, said = a_launcher(tmp_path, EEG, simulated=True)
    for command in (
        Command(Order.NOTE, "the participant is nervous", "supervisor"),
        Command(Order.DENIED, "somebody asked for end", "page"),
        Command(Order.START),
    ):
        console.give(command)
    assert launcher.run().died is None
    (file,) = tmp_path.rglob("*.h5")
    session = open_recording(file).session(1)
    events = session.events.set_index("name")["data"]
    assert events["order.note"]["text"] == "the participant is nervous"
    assert events["order.note"]["by"] == "supervisor"
    assert events["page.denied"]["why"] == "somebody asked for end"
    assert "order.start" not in events
    assert "start: the session has not begun; order it again when it has" in said
    assert said.count("eeg: is requested by type 'EEG' only, and was confirmed") == 1


class AskingRecorder(LateRecorder):
    """A recorder that flows, and asks which stream one of several is."""

    @property
    def asks(self) -> bool:
        return self.status["streams"][0]["candidates"] != []

    def __init__(self) -> None:
        super().__init__()
        fits = [{"identity": ["amp-1", "ActiChamp", "EEG"], "host": "lab-pc"}]
        self.status["streams"] = [{"label": "eeg", "required": False, "candidates": fits}]

    def confirm(self, text: str) -> tuple[str, str]:
        label, meant = answered(text, self.status["streams"])
        self.status["streams"][0]["candidates"] = []
        return label, meant[1]


@pytest.mark.parametrize("simulated", [False, True])
def test_a_session_begins_when_it_was_said_which_stream_is_meant_and_that_is_in_the_record(
    tmp_path: Path, *, simulated: bool
) -> None:
    launcher, console, said = a_launcher(tmp_path, EEG, simulated=simulated)
    launcher._recorder = recorder = AskingRecorder()
    if not simulated:  # where nobody can answer, nobody is waited for
        console.give(Command(Order.TAKE, "oxygen", "supervisor"))
        console.give(Command(Order.TAKE, "eeg", "supervisor", "10.0.0.7"))
    assert launcher._gate()
    assert recorder.asks is simulated
    if not simulated:
        assert said[0] == "take: stream 'oxygen' needs no confirmation; these do: eeg"
        assert said[1] == "stream eeg is ActiChamp"
        assert launcher._kept == [StreamConfirmed("eeg", "ActiChamp", "supervisor")]


def test_nothing_is_taken_where_no_streams_are_recorded(tmp_path: Path) -> None:
    launcher, console, said = a_launcher(tmp_path, simulated=True)
    console.give(Command(Order.TAKE, "eeg"))
    assert launcher._orders() == []
    assert said == ["take: the study records no external streams"]


STOPS_BUT_HANGS_AS_A_SPARE = """
import sys, time
from pathlib import Path
from labcrane.processes.parent import Parent
parent = Parent()
orders = parent.order()
if orders is None:
    time.sleep(600)
parent.tell({"ready": True})
while not (said := parent.messages()):
    parent.wait(1.0)
orders.journal.with_name(f"heard-{orders.part}").write_text(" ".join(said))
parent.close()
"""


@pytest.mark.slow
def test_a_spare_recorder_that_hangs_keeps_no_recorder_from_closing_its_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hanging_spare.py").write_text(STOPS_BUT_HANGS_AS_A_SPARE, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(recorder_handle, "MODULE", "hanging_spare")
    handle = RecorderHandle(tmp_path / "ses-01_streams.xdf", [])
    wait_for(lambda: handle.ready)
    for _ in range(recorder_handle.SPARES):
        assert not handle.watch()
    monkeypatch.setattr(recorder_handle, "PATIENCE_S", 3.0)
    handle.stop()
    assert [(tmp_path / f"heard-{part}").read_text(encoding="utf-8") for part in (1, 2)] == [
        "stop",
        "stop",
    ]
    assert [one.exit_code for one in handle._recorders] == [0, 0]
    assert [one.exit_code for one in handle._spares] == [-9, -9]


@pytest.mark.slow
def test_of_two_recorders_the_one_that_hangs_is_not_believed_and_neither_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_handle, "SILENT_S", 2.5)
    handle = RecorderHandle(tmp_path / "ses-01_streams.xdf", [])
    processes = [psutil.Process(one.pid) for one in handle._recorders]
    try:
        wait_for(lambda: all(one.status for one in handle._recorders))
        journals = [one.status["journal"] for one in handle._recorders]
        wait_for(lambda: handle.status.get("journal") == journals[0])
        processes[0].suspend()
        wait_for(lambda: handle.status.get("journal") == journals[1])
        processes[1].suspend()
        wait_for(lambda: handle.status == {})
        assert handle.complaints() == [
            "recorder: none has responded for over 2.5 s; check the disk of the data folder"
        ]
        assert not handle.watch()  # what they have received is not in their journals yet
        processes[0].resume()
        wait_for(lambda: handle.status.get("journal") == journals[0])
        wait_for(lambda: handle.complaints() == [])
    finally:
        for process in processes:
            process.resume()
        handle.stop()
    assert handle.restarts == 0


def test_a_recorder_that_dies_as_it_is_given_its_orders_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_handle, "MODULE", "labcrane.errors")  # ends at once
    handle = RecorderHandle(tmp_path / "ses-01_streams.xdf", [])
    wait_for(lambda: all(one.exit_code is not None for one in handle._recorders))
    assert handle.watch()
    assert handle.restarts == recorder_handle.RECORDERS
    handle.stop()


FILMED = "recordings: {face: {use: camera, device: /dev/no-camera, consent: we film your face}}\n"


@pytest.mark.slow
@pytest.mark.parametrize("required", [True, False])
def test_a_person_is_not_recorded_until_a_required_camera_is_there(
    tmp_path: Path, *, required: bool
) -> None:
    filmed = FILMED.replace("consent:", f"required: {str(required).lower()}, consent:")
    launcher, console, said = a_launcher(tmp_path, filmed, pilot=True)
    begun: list[bool] = []
    launcher._run = lambda: begun.append(True)
    thread = threading.Thread(target=launcher.run)
    thread.start()
    failed = "face: failed: '/dev/no-camera' (v4l2) cannot be opened: "
    wait_for(lambda: any(failed in line for line in said))
    console.give(Command(Order.END))
    thread.join(60)
    assert not thread.is_alive()
    assert begun == ([] if required else [True])
    assert len([line for line in said if failed in line]) == 1  # and not at each attempt
