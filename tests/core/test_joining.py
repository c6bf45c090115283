"""A feedback process that joins a session under way."""

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pylsl
from faults.sessions import unique, wait_for

from labcrane import Event, Frame, Tick
from labcrane.feedback_host import FeedbackProcess
from labcrane.host_order import HostOrder, Part
from labcrane.streams.context import ContextOutlet
from labcrane.streams.feedback_log import log_source
from labcrane.streams.frames import FrameOutlet
from labcrane.testing import TARGETS, a_run, a_target, ch8

PLUGIN = """\
from pathlib import Path

import numpy as np

from labcrane import Feedback, Settings, hookimpl, offer

labcrane_api = 1


class NotesSettings(Settings):
    file: str


class Notes(Feedback):
    def __init__(self, settings):
        self._file = Path(settings.file)

    def present(self, frame):
        with self._file.open("a") as file:
            file.write(f"{len(frame.shapes)}\\n")
        return np.zeros(0)


@hookimpl
def labcrane_feedback():
    return [offer("notes", NotesSettings, lambda settings, machine: Notes(settings))]
"""


class Session:
    """Frames of a trial, as many as are asked for."""

    def __init__(self, source: str) -> None:
        self.run = a_run(ch8(), task=TARGETS)
        self.frames = FrameOutlet(self.run, source)
        self.context = ContextOutlet(self.run, source, trials=1)
        self._number = 0

    def frame(self, *events: Event) -> Frame:
        self._number += 240  # a second each: the context is due with every one
        due = self._number / 240.0
        return replace(
            a_target(self.run), tick=Tick(self._number, due, due), trial=1, events=events
        )

    def close(self) -> None:
        self.frames.close()
        self.context.close()


def test_nothing_is_shown_before_it_is_known_what_to_show(tmp_path: Path) -> None:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "notes.py").write_text(PLUGIN)
    source, notes = unique("joining"), tmp_path / "notes"
    session = Session(source)
    order = HostOrder(
        "notes",
        Part("notes", {"file": str(notes)}),
        session.run,
        source,
        tmp_path / "study.yaml",
        always=True,
        cues={"ball": Part("sphere", {})},
    )
    said: list[dict[str, Any]] = []
    process = FeedbackProcess(order, said.append)
    thread = threading.Thread(target=process.run)
    thread.start()
    try:
        (info,) = pylsl.resolve_byprop("source_id", log_source(source, "notes"), timeout=60.0)
        recorder = pylsl.StreamInlet(info)
        recorder.open_stream(60.0)
        before = len(said)

        def it_has_looked_thrice() -> bool:
            session.frames.push(session.frame())
            return len(said) >= before + 3

        wait_for(it_has_looked_thrice, patience_s=60)
        assert not notes.exists()
        begun = Event("trial.start", 1.0, {"trial": 1, "feedback": "ball"})
        session.context.push(session.frame(begun))

        def something_is_shown() -> bool:
            session.context.push(session.frame())
            session.frames.push(session.frame())
            return notes.exists() and notes.read_text().endswith("\n")

        wait_for(something_is_shown, patience_s=60)
    finally:
        process.stop()
        thread.join()
        session.close()
    assert set(notes.read_text().split()) == {"1"}, "a picture was shown without its cue"
