"""What people say before a session runs, and recorders that do not end as they should."""

from pathlib import Path

import pytest
from faults.sessions import STUDY, unique

from labcrane import launcher as launcher_module
from labcrane import open_recording
from labcrane.console import Command, Order, QueueConsole
from labcrane.launcher import Launcher
from labcrane.session_process import VisitOrder


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

    def stop(self) -> None:
        pass


def test_a_note_that_is_given_while_streams_are_waited_for_is_in_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(launcher_module, "RecorderKeeper", LateRecorder)
    protocol = tmp_path / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("early")) + "streams: {eeg: {type: EEG}}\n")
    console, said = QueueConsole(), []
    for command in (
        Command(Order.NOTE, "the participant is nervous", "supervisor"),
        Command(Order.DENIED, "somebody asked for end", "page"),
        Command(Order.START),
    ):
        console.give(command)
    order = VisitOrder(protocol, "P001", 1, tmp_path / "data", simulated=True, feedback=False)
    assert Launcher(order, console, said.append).run().died is None
    session = open_recording(order.visit().folder.participant_file).session(1)
    events = session.events.set_index("name")["data"]
    assert events["order.note"]["text"] == "the participant is nervous"
    assert events["order.note"]["by"] == "supervisor"
    assert events["page.denied"]["why"] == "somebody asked for end"
    assert "order.start" not in events
    assert "start: the session has not begun; order it again when it has" in said
