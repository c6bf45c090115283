"""Pictures of a recorded session, taken afterwards by any camera, without recorded video.

What is drawn are the recorded numbers, which a replay gives again bit for bit, the scene of each
moment, and the machine as the recorded protocol describes it.
"""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, cast

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from labcrane.core.records import Frame, Run, SessionState
from labcrane.core.roles import Feedback
from labcrane.errors import ProtocolError, RecordingError
from labcrane.protocol.rig import Rig
from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.recording.recorded_frames import RecordedFrames
from labcrane.registry.registry import discover
from labcrane.replay.restore import restored_study
from labcrane.streams.context import situation_after

Picture = npt.NDArray[np.uint8]
CameraWords = str | Mapping[str, Any]
"""A camera's name, or one that is written out as in a protocol."""

BARE: Mapping[str, Any] = {"display": "hidden", "hud": (), "notices": False, "areas": ()}
"""Settings of a view whose pictures show only what a camera sees."""


class _Draws(Protocol):
    def open(self, run: Run) -> None: ...
    def update(self, situation: SessionState) -> None: ...
    def present(self, frame: Frame) -> object: ...
    def picture(self) -> Picture: ...
    def close(self) -> None: ...


class Retake:
    """Takes pictures of a recorded session; a context manager, since a hidden window is open.

    They show the machine, its surroundings and the task's targets, but no cues or words.

    Parameters
    ----------
    record
        The session.
    camera
        Of the view: ``"cab"``, or written out with ``name``, ``eye`` and ``look``. One at a time:
        two views in one process do not leave each other's pictures alone.
    size
        Width and height of a picture, in pixels.

    Attributes
    ----------
    name
        Of the camera, once the window is open.

    Raises
    ------
    ProtocolError
        There is no such camera; or the recorded protocol cannot be run with what is installed.
    """

    def __init__(self, record: SessionRecord, camera: CameraWords, size: tuple[int, int]) -> None:
        self._record, self._camera, self._size = record, camera, size
        self._closing = ExitStack()
        self._situation, self._told = SessionState(), -1

    def __enter__(self) -> "Retake":
        with ExitStack() as opening:
            folder = Path(opening.enter_context(TemporaryDirectory(prefix="labcrane-retake-")))
            registry = discover()
            study = restored_study(self._record, folder)
            run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
            self._frames = RecordedFrames(self._record)
            run = replace(run, axes=self._frames.axes)  # of whatever controls there were
            offer = registry.find(Feedback, "view")
            settings = _settings(offer.settings, self._camera, self._size)
            self.name: str = settings.camera.name
            self._view = cast("_Draws", offer.build(settings, study.machine))
            opening.callback(self._view.close)
            self._view.open(run)
            self._closing = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._closing.close()

    def take(self, row: int) -> Picture:
        """Return the picture of the frame in a row, shape ``(height, width, 3)``.

        Rows are asked for in order, since what is in the scene depends on what happened before.

        Raises
        ------
        RecordingError
            The row is before one that was asked for already.
        """
        if row < self._told:
            raise RecordingError(
                f"pictures are taken in order, and row {row} is before row {self._told}; open the "
                "session again"
            )
        frame = self._frames.frame(row)
        for event in self._frames.events(self._told, row):
            self._situation = situation_after(self._situation, event)
        self._told = row
        self._view.update(self._situation)
        # Shadows are those of the picture before, which here may be of a second ago.
        self._view.present(frame)
        self._view.present(frame)
        return self._view.picture()


def _settings(model: Any, words: CameraWords, size: tuple[int, int]) -> Any:
    given = {**BARE, "camera": words, "size": size}
    try:
        return model.model_validate(given)
    except ValidationError as error:
        problems = "; ".join(one["msg"].removeprefix("Value error, ") for one in error.errors())
        raise ProtocolError(f"camera {words!r}: {problems}") from None
