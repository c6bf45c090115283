"""Preview of a movement as pictures and sound files, without session, display or device."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from labcrane.core.records import Event, Frame, SessionState
from labcrane.errors import ProtocolError
from labcrane.feedback.presenter import Presenter
from labcrane.feedback.processes import host_orders
from labcrane.files.pseudonyms import pseudonyms
from labcrane.machines.scene_codec import SCENE_PLACED
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.recording.frame_log import LOOP, FrameRow
from labcrane.recording.participant_file.reader import SessionRecord, open_recording
from labcrane.registry.registry import discover
from labcrane.session.commands import Command, Order, QueueConsole
from labcrane.session.session import run as run_session
from labcrane.session.visit import Visit


def write_preview(
    study: Study,
    folder: Path,
    recording: Path | None = None,
    session: int = 1,
    trial: int | None = None,
    say: Callable[[str], None] = print,
) -> list[Path]:
    """Write pictures and sounds of one movement with everything switched on.

    Parameters
    ----------
    recording
        Participant file with the movement; None simulates one.
    trial
        Number of the trial; None is the first counted one.
    say
        Told which views and sounds write no file.

    Returns
    -------
    list of Path
        The files written: pictures of every view, a sound file of every sound.

    Raises
    ------
    ProtocolError
        None of them writes a file, the study has none, or there is no such trial.
    """
    frames, scene = chosen(study, recording, session, trial)
    run = Rig.build(study, simulated=True).describe(study, participant_seed=0)
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for order in host_orders(study, run, "preview"):
        presenter = Presenter(order, discover(study=study.path))
        try:
            for cue in presenter.cues.values():
                cue.open(run)
            drawn = [_drawn(presenter, frame) for frame in frames]
            presenter.update(SessionState(scene=scene))
            files = presenter.feedback.preview(run, drawn, folder / order.name)
        finally:
            presenter.close()
        written += files
        if not files:
            say(
                f"feedback {order.name!r} writes no file: its plugin {order.part.use!r} has no "
                "preview; a session presents it"
            )
    if not written:
        raise ProtocolError(
            f"{study.path}: nothing was written, as none of its views and sounds has a preview; "
            "labcrane run --simulate --feedback presents them"
        )
    return written


def chosen(
    study: Study, recording: Path | None, session: int, trial: int | None
) -> tuple[list[Frame], str]:
    """Return the frames of one movement, and the scene; as for :func:`write_preview`.

    Raises
    ------
    ProtocolError
        The study has neither views nor sounds, or there is no such trial.
    """
    if not (study.views or study.sounds):
        raise ProtocolError(f"{study.path} has neither views nor sounds; add views: or feedback:")
    if recording is not None:
        record = open_recording(recording).session(session)
        return movement(record, trial), scene_of(record, trial)
    with tempfile.TemporaryDirectory(prefix="labcrane-preview-") as place:
        record = open_recording(_simulated(study, Path(place))).session(1)
        return movement(record, trial), scene_of(record, trial)


def movement(record: SessionRecord, trial: int | None = None) -> list[Frame]:
    """Return the frames of a recorded trial; by default of the first counted one.

    Raises
    ------
    ProtocolError
        There is no such trial.
    """
    parts = {name: stream.data for name, stream in record.streams.items()}
    loop = parts["loop"]
    counted = record.trials["trial"]
    if trial is None and len(counted):
        trial = int(counted.iloc[0])
    rows = np.flatnonzero(loop["trial"] == trial)
    if not len(rows):
        there = ", ".join(str(int(number)) for number in counted.unique()) or "none"
        raise ProtocolError(f"there is no trial {trial} in the recording; there is {there}")
    arrays = [parts[name].to_numpy() for name in ("input", "command", "state", "task")]
    head = loop[[each.name for each in LOOP]].to_numpy()
    frame = FrameRow(array.shape[1] for array in arrays).frame
    return [frame(row) for row in np.column_stack([head, *arrays])[rows]]


def scene_of(record: SessionRecord, trial: int | None = None) -> str:
    """Return the scene around the machine in a recorded trial; empty for none."""
    if trial is None:
        trial = int(record.trials["trial"].iloc[0])
    events = record.events
    placed = events[(events["name"] == SCENE_PLACED) & (events["trial"] == trial)]
    return "" if placed.empty else str(placed["data"].iloc[-1]["things"])


def _drawn(presenter: Presenter, frame: Frame) -> Frame:
    shapes = [shape for cue in presenter.cues.values() for shape in cue.draw(frame)]
    return replace(frame, shapes=tuple(shapes))


class _UntilCounted(QueueConsole):
    """Ends the session when the first counted trial is over."""

    def report(self, event: Event) -> None:
        if event.name == "trial.end" and event.data["counted"]:
            self.give(Command(Order.END))


def _simulated(study: Study, folder: Path) -> Path:
    """Run a session up to its first counted trial; return the participant file."""
    name = pseudonyms(study.protocol.participants.pattern, 1)[0]
    return run_session(Visit(study, name, 1, folder, simulated=True, fast=True), _UntilCounted())
