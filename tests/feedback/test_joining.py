"""A feedback process that joins a session under way."""

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pylsl
import pytest
from faults.sessions import unique, wait_for

from labcrane import Frame, StreamError, Tick
from labcrane.core import Event
from labcrane.feedback import process
from labcrane.feedback.config import ComponentConfig, FeedbackConfig
from labcrane.feedback.process import FeedbackProcess
from labcrane.streams.context import CONTEXT, ContextOutlet
from labcrane.streams.feedback_log import log_source
from labcrane.streams.frames import FRAME, FrameOutlet
from labcrane.streams.recorder import recorder
from labcrane.streams.request import StreamRequest
from labcrane.testing import TARGETS, ch8, make_run, make_target
from labcrane.web.pictures import Pictures

PLUGIN = """\
from pathlib import Path

import numpy as np

from labcrane import Feedback, Settings, hookimpl, offer
from labcrane.core import CameraImage

labcrane_api = 1


class NotesSettings(Settings):
    file: str


class Notes(Feedback):
    cameras = ("eye",)

    def __init__(self, settings):
        self._file = Path(settings.file)

    def present(self, frame):
        with self._file.open("a") as file:
            file.write(f"{len(frame.shapes)}\\n")
        self._due = frame.tick.due
        return np.zeros(0)

    def pictures(self):
        self._file.with_suffix(".pictures").touch()
        return {"eye": CameraImage(np.zeros((2, 3), np.uint8), self._due)}


@hookimpl
def labcrane_feedback():
    return [offer("notes", NotesSettings, lambda settings, machine: Notes(settings))]
"""


class Session:
    """Frames of a trial, as many as are asked for."""

    def __init__(self, source: str) -> None:
        self.run = make_run(ch8(), task=TARGETS)
        self.frames = FrameOutlet(self.run, source)
        self.context = ContextOutlet(self.run, source, {1: 1})
        self._number = 0

    def frame(self, *events: Event) -> Frame:
        self._number += 240  # a second each: the context is due with every one
        due = self._number / 240.0
        return replace(
            make_target(self.run), tick=Tick(self._number, due, due), trial=1, events=events
        )

    def close(self) -> None:
        self.frames.close()
        self.context.close()


class Joined:
    """A feedback process that follows a session; what it wrote down, and what it said."""

    def __init__(self, folder: Path) -> None:
        (folder / "plugins").mkdir()
        (folder / "plugins" / "notes.py").write_text(PLUGIN, encoding="utf-8")
        self.source, self.notes = unique("joining"), folder / "notes.txt"
        self.session = Session(self.source)
        order = FeedbackConfig(
            "notes",
            ComponentConfig("notes", {"file": str(self.notes)}),
            self.session.run,
            self.source,
            folder / "study.yaml",
            always=True,
            cues={"ball": ComponentConfig("sphere", {})},
        )
        self.said: list[dict[str, Any]] = []
        self._process = FeedbackProcess(order, self.said.append)
        self._process.offer(
            {
                FRAME: self.session.frames.description,
                CONTEXT: self.session.context.description,
            }
        )
        self._thread = threading.Thread(target=self._process.run)
        self._thread.start()

    def record(self) -> None:
        """Receive what it says it has presented, as the recorder does."""
        wanted = log_source(self.source, "notes")
        (info,) = pylsl.resolve_byprop("source_id", wanted, timeout=240.0)
        self._recorder = pylsl.StreamInlet(info)
        self._recorder.open_stream(240.0)

    def shown(self) -> list[str]:
        """Send a frame and the context; return how many shapes each picture had."""
        self.session.context.push(self.session.frame())
        self.session.frames.push(self.session.frame())
        return self.notes.read_text(encoding="utf-8").split() if self.notes.exists() else []

    def close(self) -> None:
        self._process.stop()
        self._thread.join()
        self.session.close()


@pytest.fixture
def joined(tmp_path: Path) -> Iterator[Joined]:
    made = Joined(tmp_path)
    yield made
    made.close()


def test_nothing_is_shown_before_it_is_known_what_to_show(joined: Joined) -> None:
    joined.record()
    before = len(joined.said)

    def it_has_looked_around() -> bool:
        joined.session.frames.push(joined.session.frame())
        return len(joined.said) > before + 3

    wait_for(it_has_looked_around, patience_s=240)
    assert not joined.notes.exists()
    begun = Event("trial.start", 1.0, {"trial": 1, "feedback": "ball"})
    joined.session.context.push(joined.session.frame(begun))
    wait_for(joined.shown, patience_s=240)
    assert set(joined.shown()) == {"1"}, "a picture was shown without its cue"


def test_pictures_for_the_supervisor_are_made_only_while_somebody_watches(joined: Joined) -> None:
    joined.record()
    wait_for(lambda: len(joined.shown()) > 5, patience_s=240)
    assert not joined.notes.with_suffix(".pictures").exists()
    with closing(Pictures(joined.source, {"notes": ("eye",)})) as page:

        def a_picture_has_come() -> bool:
            joined.shown()
            return page.of("notes", "eye")[1] != "no picture yet"

        wait_for(a_picture_has_come, patience_s=240)


class Nobody:
    """A search that finds nothing, as where all of liblsl's ports are taken."""

    def __init__(self, **_: object) -> None: ...

    def results(self) -> list[pylsl.StreamInfo]:
        return []

    def close(self) -> None: ...


def test_a_recorder_takes_what_is_presented_without_a_search(
    joined: Joined, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "Search", Nobody)
    wait_for(lambda: any("sends" in one for one in joined.said), patience_s=240)
    sends = next(one["sends"] for one in joined.said if "sends" in one)
    wanted = StreamRequest(label="notes", source_id=log_source(joined.source, "notes"))
    with closing(recorder.Recorder(tmp_path / "streams.xdf", [wanted])) as recording:
        recording.look()
        assert recording.health()[0].condition == "absent"
        recording.know(sends)
        wait_for(joined.shown, patience_s=240)
        assert recording.health()[0].condition != "absent"


def test_who_is_not_recorded_or_hears_nothing_says_why_after_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(process, "TAKEN_S", 0.2)
    joining = process.FeedbackProcess(
        SimpleNamespace(name="notes", recorded=True, streams={}), lambda _: None
    )
    for text, why in (
        ("a trial", r"no recorder has received the stream of 'notes'.*PortRange"),
        ("", r"'notes' found the session's streams but received nothing from them.*firewall"),
    ):
        context = SimpleNamespace(text=text, changed=time.sleep)
        with pytest.raises(StreamError, match=why):
            joining._join(context, SimpleNamespace(taken=False))
