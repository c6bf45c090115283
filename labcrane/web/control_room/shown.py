"""Shapes around the machine, as the session's views draw them: targets, and what cues show."""

import json
import threading
import time
from collections.abc import Iterator, Mapping

import numpy as np

from labcrane.core.primitives import Shape, TargetFinder
from labcrane.core.records import Frame, Run, SessionState
from labcrane.core.roles import Cue
from labcrane.protocol.components import ComponentSpec
from labcrane.recording.frame_log import FrameRow, sizes
from labcrane.recording.run_codec import read_run
from labcrane.streams.context import CONTEXT, situation_of
from labcrane.streams.frames import frame_columns
from labcrane.streams.newest import NewestSample

PAUSE_S = 0.1
LOOP = "loop"


class ShownShapes:
    """Draws what the views of a session draw, from the newest frame and the session's context.

    Attributes
    ----------
    run
        What is run, as the session tells; None before it has.
    trouble
        Why the newest that the session told could not be taken up; empty when it was.
    """

    def __init__(self, cues: Mapping[str, ComponentSpec]) -> None:
        self.run: Run | None = None
        self.trouble = ""
        self._specs = cues
        self._cues: dict[str, Cue] = {}
        self._built_for: Mapping[str, Mapping[str, object]] = {}
        self._situation = SessionState()
        self._labels: list[str] = []

    def follow(self, source: str) -> None:
        """Follow a session's context, in a thread."""
        threading.Thread(target=self._follow, args=(source,), name="context", daemon=True).start()

    def take(self, run: Run) -> None:
        """Take up what is run."""
        self._cues, self._built_for = {}, {}
        self._targets = TargetFinder(run.task)
        self._row = FrameRow(sizes(run), wrote=False)
        self._labels = [
            each.label if each.group == LOOP
            else f"{'axes' if each.group == 'input' else each.group}.{each.label}"
            for each in frame_columns(run)
        ]  # fmt: skip
        self.run = run

    def situate(self, situation: SessionState) -> None:
        """Take up what the session is about."""
        self._situation = situation

    def shapes(self, newest: Mapping[str, float]) -> list[Shape]:
        """Return the shapes around the machine; nothing before a frame has come.

        Parameters
        ----------
        newest
            A frame, by the columns of :data:`labcrane.streams.frames.FRAME`.
        """
        if self.run is None or not newest.keys() >= set(self._labels):
            return []
        row = np.array([newest[label] for label in self._labels])
        frame = self._row.frame(row)
        return [*self._targets.find(frame.task), *self._drawn(frame)]

    def _drawn(self, frame: Frame) -> Iterator[Shape]:
        if not frame.trial:
            return
        self._build()
        for name, cue in self._cues.items():
            if name in self._situation.active:
                yield from cue.draw(frame)

    def _build(self) -> None:
        """Build the cues with the settings that they have now."""
        assert self.run is not None  # noqa: S101 - asked before
        for name, spec in self._specs.items():
            changed = self._situation.settings.get(name, {})
            if name in self._cues and changed == self._built_for.get(name, {}):
                continue
            settings = type(spec.settings).model_validate({**spec.settings.model_dump(), **changed})
            cue = spec.offer.build(settings, self.run.machine)
            assert isinstance(cue, Cue)  # noqa: S101 - the registry filed it under its role
            cue.open(self.run)
            self._cues[name] = cue
            self._built_for = {**self._built_for, name: dict(changed)}

    def _follow(self, source: str) -> None:
        inlet = NewestSample({"source_id": f"labcrane/{source}/{CONTEXT}"}, buffer_s=2)
        scene = ""
        while True:
            samples, stamps = inlet.pull()
            if stamps:
                scene = self.hear(str(samples[-1][0]), scene)
            time.sleep(PAUSE_S)

    def hear(self, text: str, scene: str) -> str:
        """Take up a text of the session's context; return the scene that is drawn now.

        Parameters
        ----------
        scene
            The scene that was drawn before.
        """
        try:
            said = json.loads(text)
            told = json.dumps(said["scene"])
            if told != scene:
                self.take(read_run(told))
            self.situate(situation_of(said["situation"]))
        # Whatever it is: a thread that dies of it would leave a picture that stands still.
        except Exception as error:  # noqa: BLE001 - said on the page
            self.trouble = f"{type(error).__name__}: {error}"
            return scene
        self.trouble = ""
        return told
