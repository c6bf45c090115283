"""Participants recorded in seconds, real ones as far as their stamps go."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rehearsal import ScriptedConsole, a_study

from labcrane import FloatArray
from labcrane.core import Event
from labcrane.core.clock import ManualClock
from labcrane.protocol.rig import Rig
from labcrane.recording import Channel, StreamHeader, XdfWriter
from labcrane.recording.foreign_streams import companion_headers
from labcrane.recording.frame_log import FrameLog, columns
from labcrane.recording.journal import EVENTS, SessionJournal
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.xdf.reader import read_xdf
from labcrane.session import loop
from labcrane.session.metadata import context
from labcrane.session.postprocess import conclude
from labcrane.session.sequencer import Sequencer
from labcrane.session.visit import claim
from labcrane.testing import Command, Study, Visit, plan_session

STUDY = """\
labcrane: 1
study: results
title: Übung mit dem Kran
participants: {pattern: 'P\\d{3}', planned: 4}
rate_hz: 120
machine: ch8
input: {use: dual_joystick}
operator: {use: simulated_operator, pace_sd: 0.2, fitts_a_s: 0.6, fitts_b_s: 1.2}
scheme:
  use: joint_velocity
  map: {slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}
dynamics: {use: kinematic_crane}
tasks:
  aiming: {use: aiming, distances: [2, 3], movements: 2}
design:
  order: {pairs: shuffled}
sessions:
  - name: acquisition
    steps:
      - block: {task: aiming}
"""


def study(folder: Path, text: str = STUDY) -> Study:
    folder.mkdir(parents=True, exist_ok=True)
    return a_study(folder, text)


def record(
    chosen: Study,
    data: Path,
    participant: str,
    *,
    simulated: bool = False,
    pilot: bool = False,
    orders: Mapping[int, Sequence[Command]] | None = None,
    gaze: bool | Sequence[str] | Callable[[FloatArray], FloatArray] = False,
    stated: Sequence[str] = ("screen",),
    eeg: bool = False,
    shown: Mapping[str, Callable[[float], FloatArray]] | None = None,
    others: Sequence[str] = (),
    also: Callable[[XdfWriter, float, FloatArray], None] | None = None,
) -> Path:
    """Record session 1; a program takes the controls, whatever the stamps say.

    ``gaze`` is of eyes that name what they look at; or, by the names of cameras, of eyes that look
    somewhere in the window, beside the areas that a view has shown there; or, as a function of
    times on the session's clock, of eyes whose place in the window is known, in pixels. ``stated``
    has the coordinate system that the header of each stream in pixels states. ``shown`` says when
    each view showed its pictures, by its name, in a session that ended at that time. ``others`` are
    names of streams at 25 Hz, each of which holds its own number. ``also`` writes more: it is
    called with the journal of streams, the session's end and the times of its events.
    """
    visit = Visit(chosen, participant, 1, data, simulated=simulated, fast=True, pilot=pilot)
    plan = plan_session(chosen, participant, 1)
    claim(visit)
    rig = Rig.build(chosen, simulated=True)
    clock = ManualClock(start=100.0)
    with rig.opened(chosen, plan.seed) as run:
        sequencer = Sequencer(chosen, plan, rig, waits=False)
        with SessionJournal(visit.journal, columns(run), run.rate_hz) as journal:
            log = FrameLog(journal, run)
            log.note(Event("session.start", clock.now(), context(visit, plan, rig, run)))
            loop.run(rig, run, sequencer, clock, ScriptedConsole(orders), log, [])
    journals = [visit.journal]
    if gaze or eeg or shown or others or also:
        journals.append(visit.streams_journal)
        with XdfWriter(visit.streams_journal) as writer:
            if gaze is True:
                _gaze(writer, clock.now())
            elif callable(gaze):
                _gaze_at(writer, clock.now(), gaze)
            elif gaze:
                _gaze_in_window(writer, clock.now(), gaze, stated)
            for name, pictures in (shown or {}).items():
                _pictures(writer, name, pictures(clock.now()))
            for number, name in enumerate(others):
                header = StreamHeader(
                    name, "EDA", (Channel("a", "uS"),), "float32", 25.0, f"n{number}"
                )
                time = np.arange(95.0, clock.now(), 0.04)
                write_stream(writer, header, time, 0.0, np.full((len(time), 1), number, np.float32))
            events = read_xdf(visit.journal).stream(EVENTS).stamps
            if also:
                also(writer, clock.now(), events)
            if eeg:
                _eeg(writer, clock.now(), events)
                _pulse(writer, clock.now())
    consolidate(visit.folder.participant_file, journals, conclude)
    return visit.folder.participant_file


OFFSET_S = 5000.0


def _gaze(writer: XdfWriter, until: float) -> None:
    """Write eyes that look at the target for the first half of each second, at 50 Hz."""
    channels = (Channel("x", "m"), Channel("y", "m"), Channel("aoi", ""))
    header = StreamHeader("eyes", "Gaze", channels, "double64", 50.0, source_id="eyes")
    time = np.arange(90.0, until, 0.02)
    data = np.column_stack([np.sin(time), np.cos(time), (time % 1.0 < 0.5) * 1.0])
    write_stream(writer, header, time, OFFSET_S, data)


def in_pixels(stated: str) -> tuple[Channel, ...]:
    """Return the channels of gaze in pixels, of what the header states."""
    extra = {"coordinate_system": stated} if stated else {}
    return tuple(Channel(f"gaze_{axis}", "px", extra=extra) for axis in "xy")


def _gaze_in_window(
    writer: XdfWriter, until: float, cameras: Sequence[str], stated: Sequence[str]
) -> None:
    """Write the same eyes by where they look, and two areas of each camera's picture at 60 Hz.

    What is looked at in the first half of each second is the target of the last camera, and
    otherwise nothing; for a while the target is out of the picture, and in it under the tip.
    """
    time = np.arange(90.0, until, 0.02)
    on = time % 1.0 < 0.5
    x = np.where(on, 100.0 + 1000.0 * (len(cameras) - 1), 700.0)
    spots = np.column_stack([x, np.full(len(time), 50.0)])
    for name, said in zip(("eyes", "glasses", "relay"), stated, strict=False):
        header = StreamHeader(name, "Gaze", in_pixels(said), "double64", 50.0, source_id=name)
        write_stream(writer, header, time, OFFSET_S, spots)
    boxes = []
    for at in range(len(cameras)):
        left = 1000.0 * at
        boxes += [left, 0.0, left + 200.0, 100.0, left + 80.0, 30.0, left + 120.0, 70.0]
    sides = ("left", "top", "right", "bottom")
    labels = [f"{c}.{what}.{side}" for c in cameras for what in ("tip", "target") for side in sides]
    header = StreamHeader(
        "labcrane.feedback.cab.areas",
        "labcrane.feedback",
        tuple(Channel(label, "px") for label in labels),
        "double64",
        source_id="areas",
    )
    shown = np.arange(90.0, until, 1 / 60)
    write_stream(writer, header, shown, 0.0, np.tile(boxes, (len(shown), 1)))


def _gaze_at(writer: XdfWriter, until: float, where: Callable[[FloatArray], FloatArray]) -> None:
    """Write eyes at 120 Hz by where in the window they look."""
    channels = in_pixels("screen")
    header = StreamHeader("eyes", "Gaze", channels, "double64", 120.0, source_id="eyes")
    time = np.arange(90.0, until, 1.0 / 120.0)
    write_stream(writer, header, time, OFFSET_S, where(time))


def _pictures(writer: XdfWriter, name: str, time: FloatArray) -> None:
    """Write what a view says of its pictures."""
    header = StreamHeader(
        f"labcrane.feedback.{name}", "Feedback", (Channel("frame.tick", "1"),), "double64",
        source_id=name,
    )  # fmt: skip
    write_stream(writer, header, time, 0.0, np.zeros((len(time), 1)))


EEG_HZ = 250.0
LOST = slice(3000, 3100)
"""Samples of EEG that never came."""


_FZ = {"event": "signal", "channel": "Fz", "kind": "flat line", "message": "does not move"}
FLAT = {110.0: {**_FZ, "bad": True}, 125.0: {**_FZ, "bad": False}}
"""What a monitor told of Fz, by the time of it."""

NOTHING: Mapping[float, Mapping[str, object]] = {}


def _eeg(writer: XdfWriter, until: float, events: FloatArray) -> None:
    """Write EEG with a pulse at the sample nearest to each event; its clock is 40 ppm slow."""
    units = ("microvolts", "microvolts", "microvolts", "")
    kinds = ("EEG", "EEG", "EOG", "Trigger")
    named = zip(("Fz", "Cz", "HEOG", "pulse"), units, kinds, strict=True)
    channels = tuple(Channel(label, unit, kind) for label, unit, kind in named)
    about = {
        "acquisition": {"manufacturer": "Somebody"},
        "synchronization": {"can_drop_samples": "false"},
    }
    header = StreamHeader("BrainAmp", "EEG", channels, "float32", EEG_HZ, "amp", about)
    time = np.arange(95.0, until, (1.0 + 40e-6) / EEG_HZ)
    data = np.random.default_rng(5).normal(0.0, 20.0, (len(time), 4)).astype(np.float32)
    data[:, 3] = 0.0
    at = np.searchsorted(0.5 * (time[1:] + time[:-1]), events[(events > 95.0)])
    data[at, 3] = 1.0
    keep = np.ones(len(time), bool)
    keep[LOST] = False
    write_stream(writer, header, time[keep], 777.0, data[keep], drift=-40e-6, told=FLAT)


def _pulse(writer: XdfWriter, until: float) -> None:
    """Write a heart's signal."""
    channel = Channel("ecg", "millivolts", "ECG")
    header = StreamHeader("Heart", "ECG", (channel,), "int16", 100.0, source_id="heart")
    time = np.arange(96.0, until, 0.01)
    write_stream(writer, header, time, 0.0, (100 * np.sin(time))[:, None].astype(np.int16))


def write_stream(
    writer: XdfWriter,
    header: StreamHeader,
    time: FloatArray,
    offset: float,
    data: npt.NDArray[np.generic],
    drift: float = 0.0,
    told: Mapping[float, Mapping[str, object]] = NOTHING,
) -> None:
    """Write samples taken at ``time`` on our clock, stamped with the source's; and its probes."""

    number = writer.add_stream(header)
    beside = companion_headers(header, number)
    probes = writer.add_stream(beside["probes"])
    stamps = time - offset + drift * (time - 90.0)
    writer.write_samples(number, stamps, data)
    local = np.arange(90.0, time[-1] + 5.0, 5.0)
    n, remote = len(local), local - offset + drift * (local - 90.0)
    rows = np.column_stack([remote, local - remote, np.full(n, 1e-4), local])
    writer.write_samples(probes, local, rows)
    arrivals = writer.add_stream(beside["arrivals"])
    pulls = np.arange(time[0], time[-1] + 0.1, 0.1)
    count = np.searchsorted(time, pulls, side="right")
    came = np.flatnonzero(np.diff(count, prepend=0))
    rows = np.column_stack([count[came], pulls[came]]).astype(float)
    writer.write_samples(arrivals, pulls[came], rows)
    notes = writer.add_stream(beside["notes"])
    texts = {90.0: {"event": "begin"}, **told}
    writer.write_texts(notes, list(texts), [(json.dumps(each),) for each in texts.values()])
