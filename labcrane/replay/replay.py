"""A recorded session run again from its input.

The loop, the plan and the components are those of a session; the operator's axes, the orders of the
people in the room and the faults of the controls come from the record, each at the tick at which
it took effect. Nothing else changes a state, so the same versions give the
same numbers, bit for bit.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.clock import SystemClock, Tick
from labcrane.core.records import Frame, Run
from labcrane.design.plan import plan_session
from labcrane.errors import ProtocolError, RecordingError
from labcrane.protocol.rig import Rig, build_controller
from labcrane.protocol.study import Study
from labcrane.recording.data_folder import DataFolder
from labcrane.recording.frame_log import FrameLog, FrameRow, columns, sizes
from labcrane.recording.participant_file.reader import SessionRecord, open_recording
from labcrane.replay.restore import differing_parts, restored_study
from labcrane.replay.script import RecordOver, Script
from labcrane.session import loop
from labcrane.session.resume import Ledger, Progress, carried_in, judged_in
from labcrane.session.sequencer import Sequencer

if TYPE_CHECKING:
    import pandas as pd

COMPARED = ("tick", "trial", "elapsed", "phase", "paused")
"""Of the loop's columns; when ticks woke is not the machine's doing."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first number that is not what was recorded.

    Attributes
    ----------
    tick
        In which tick, counted from 0.
    column
        Which: ``state.joint.angle.slew``; "length" when one of them is longer.
    recorded, replayed
        The two numbers, in the signals' units; ticks for the length.
    """

    tick: int
    column: str
    recorded: float
    replayed: float


@dataclass(frozen=True)
class Replayed:
    """Result of a replay.

    Attributes
    ----------
    ticks
        How many were run.
    parts
        Every part that mattered and is not what it was, in words.
    difference
        The first one, or None: every number is the recorded one, bit for bit.
    frames
        What was replayed, as the record has it: loop, input, command, state and task.
    """

    ticks: int
    parts: tuple[str, ...]
    difference: Difference | None
    frames: Mapping[str, "pd.DataFrame"]


def replay_session(
    path: Path,
    session: int,
    *,
    protocol: Path | None = None,
    machine: Path | None = None,
    speed: float | None = None,
    sinks: Sequence[Callable[[Frame], None]] = (),
    run_code: bool = False,
) -> Replayed:
    """Run a recorded session again, and compare every number.

    Parameters
    ----------
    path, session
        The participant file, and which of its sessions.
    protocol
        A protocol file to run instead of the recorded text.
    machine
        A machine file to operate instead of the recorded one.
    speed
        Show it on the LSL streams of a session, so many times as fast as it was; None runs as fast
        as the computer can and shows nothing.
    sinks
        Called with every frame: whatever is to be measured now.
    run_code
        Whether plugins in the recording are imported: they are programs of the file's author.

    Raises
    ------
    RecordingError
        There is no such session, or it was interrupted and resumed.
    ProtocolError
        The record's protocol cannot be run with what is installed.
    """
    record = open_recording(path).session(session)
    if speed is not None and not speed > 0.0:
        raise ProtocolError(
            f"a speed of {speed:g} shows nothing; give one above 0, such as 2 for double speed"
        )
    if (runs := int(record.events["part"].max())) > 1:
        raise RecordingError(
            f"session {session} of {path} was run in {runs} parts; the state at a resumption is "
            "not part of the input, so only sessions without interruption can be replayed"
        )
    with TemporaryDirectory(prefix="labcrane-replay-") as folder:
        study = restored_study(record, Path(folder), protocol, machine, run_code=run_code)
        parts = differing_parts(record, study)
        return _run(record, study, session, parts, speed, sinks)  # components read files too


def _run(
    record: SessionRecord,
    study: Study,
    session: int,
    parts: tuple[str, ...],
    speed: float | None,
    sinks: Sequence[Callable[[Frame], None]],
) -> Replayed:
    script = Script(record)
    participant = DataFolder.pseudonym(str(record.context["participant"]))
    plan = plan_session(study, participant, session)
    controller, dynamics = build_controller(study), study.dynamics.build(study.machine)
    rig = Rig(script.input, controller, dynamics, study.tasks)  # type: ignore[arg-type]
    with ExitStack() as closing:
        run = closing.enter_context(rig.opened(study, plan.seed))
        log = _Log(run, script)
        waits = not bool(record.context["simulated"])
        # Recordings of before tests waited to be judged go on at once, as they did.
        so_far = Progress(carried=carried_in(record.context), judged=judged_in(record.context))
        ledger = Ledger(study, plan, so_far)
        sequencer = Sequencer(
            study, plan, rig, waits=waits, awaits=script.awaited, ledger=ledger,
            sets_back=bool(record.context.get("sets_back")),
        )  # fmt: skip
        shown: list[Callable[[Frame], None]] = []
        if speed is not None:
            show = _Show(run, f"replay/{participant}/ses-{session:02}", speed)
            closing.callback(show.close)
            shown.append(show)
        with suppress(RecordOver):
            loop.run(rig, run, sequencer, script.clock, script, log, (*sinks, *shown))
    parts = (*parts, *log.unrecorded(record))
    return Replayed(log.ticks, parts, log.compare(record), log.frames())


class _Log(FrameLog):
    """Keeps every number of every frame instead of writing it to a journal."""

    def __init__(self, run: Run, script: "Script") -> None:
        self._script = script
        self._columns = columns(run)
        self._fill = FrameRow(sizes(run)).fill
        self._rows = np.full((script.ticks, len(self._columns)), np.nan)
        self.ticks = 0

    @property
    def trouble(self) -> str | None:  # type: ignore[override]  # recorded, not found out
        """The disk's fault in this tick."""
        return self._script.disk_trouble

    def write(self, frame: Frame) -> None:
        self._fill(self._rows[self.ticks], frame, 0.0)
        self.ticks += 1

    def frames(self) -> dict[str, "pd.DataFrame"]:
        import pandas as pd  # noqa: PLC0415 - loads for a second

        return {
            group: pd.DataFrame(
                {
                    column.label: self._rows[: self.ticks, number]
                    for number, column in enumerate(self._columns)
                    if column.group == group
                }
            )
            for group in dict.fromkeys(column.group for column in self._columns)
        }

    def unrecorded(self, record: SessionRecord) -> Iterator[str]:
        """Yield, in words, the columns that the recording has not: they cannot be compared."""
        for column in self._columns:
            if column.label not in record.streams[column.group].data:
                yield f"{column.group}.{column.label}: not recorded, now there"

    def compare(self, record: SessionRecord) -> Difference | None:
        """Return the first number that differs; NaN equals NaN, 0 does not equal -0."""
        first: Difference | None = None
        for number, column in enumerate(self._columns):
            if column.group == "loop" and column.label not in COMPARED:
                continue
            name = f"{column.group}.{column.label}"
            table = record.streams[column.group].data
            if column.label not in table:
                continue  # said by unrecorded
            recorded = table[column.label].to_numpy(np.float64)[: self.ticks]
            replayed = np.ascontiguousarray(self._rows[: self.ticks, number])
            same = recorded.view(np.int64) == replayed.view(np.int64)
            same |= np.isnan(recorded) & np.isnan(replayed)
            if not same.all():
                at = int(np.argmin(same))
                if first is None or at < first.tick:
                    first = Difference(at, name, float(recorded[at]), float(replayed[at]))
        if first is None and self.ticks < len(self._rows):
            return Difference(self.ticks, "length", float(len(self._rows)), float(self.ticks))
        return first


class _Show:
    """Puts frames on the streams of a session, at a pace."""

    def __init__(self, run: Run, source: str, speed: float) -> None:
        from labcrane.streams.outlets import Outlets  # noqa: PLC0415 - loads liblsl

        self._outlets = Outlets(run, source)
        self._clock = SystemClock()
        self._start = self._clock.now()
        self._step = 1.0 / (run.rate_hz * speed)
        self.close = self._outlets.close

    def __call__(self, frame: Frame) -> None:
        due = self._start + frame.tick.number * self._step
        self._clock.wait_until(due)
        events = tuple(replace(event, time=due) for event in frame.events)
        now = Tick(frame.tick.number, due, self._clock.now())
        self._outlets.push(replace(frame, tick=now, events=events))
