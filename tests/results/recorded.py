"""Participants recorded in seconds, real ones as far as their stamps go."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rehearsal import ScriptedConsole, a_study

from labcrane.core.clock import ManualClock
from labcrane.core.records import Event
from labcrane.design.plan import plan_session
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study
from labcrane.recording.foreign_streams import companion_headers
from labcrane.recording.frame_log import FrameLog, columns
from labcrane.recording.journal import SessionJournal
from labcrane.recording.participant_file.writer import consolidate
from labcrane.recording.xdf.header import Channel, StreamHeader
from labcrane.recording.xdf.writer import XdfWriter
from labcrane.session import loop
from labcrane.session.commands import Command
from labcrane.session.metadata import context
from labcrane.session.postprocess import conclude
from labcrane.session.sequencer import Sequencer
from labcrane.session.session import Visit

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
    the_study: Study,
    data: Path,
    participant: str,
    *,
    simulated: bool = False,
    pilot: bool = False,
    orders: Mapping[int, Sequence[Command]] | None = None,
    gaze: bool = False,
) -> Path:
    """Record session 1; a program takes the controls, whatever the stamps say."""
    visit = Visit(the_study, participant, 1, data, simulated=simulated, fast=True, pilot=pilot)
    plan = plan_session(the_study, participant, 1)
    visit.folder.claim(1)
    rig = Rig.build(the_study, simulated=True)
    clock = ManualClock(start=100.0)
    with rig.opened(the_study, plan.seed) as run:
        sequencer = Sequencer(the_study, plan, rig, waits=False)
        with SessionJournal(visit.journal, columns(run), run.rate_hz) as journal:
            log = FrameLog(journal, run)
            log.note(Event("session.start", clock.now(), context(visit, plan, rig, run)))
            loop.run(rig, run, sequencer, clock, ScriptedConsole(orders), log, [])
    journals = [visit.journal]
    if gaze:
        journals.append(_gaze(visit.streams_journal, clock.now()))
    consolidate(visit.folder.participant_file, journals, conclude)
    return visit.folder.participant_file


OFFSET_S = 5000.0


def _gaze(path: Path, until: float) -> Path:
    """Write eyes that look at the target for the first half of each second, at 50 Hz."""
    channels = (Channel("x", "m"), Channel("y", "m"), Channel("aoi", ""))
    header = StreamHeader("eyes", "Gaze", channels, "double64", 50.0, source_id="eyes")
    time = np.arange(90.0, until, 0.02)
    data = np.column_stack([np.sin(time), np.cos(time), (time % 1.0 < 0.5) * 1.0])
    with XdfWriter(path) as writer:
        number = writer.add_stream(header)
        beside = companion_headers(header, number)
        probes = writer.add_stream(beside["probes"])
        writer.write_samples(number, time - OFFSET_S, data)
        local = np.arange(90.0, until, 5.0)
        n = len(local)
        rows = np.column_stack([local - OFFSET_S, np.full(n, OFFSET_S), np.full(n, 1e-4), local])
        writer.write_samples(probes, local, rows)
        arrivals = writer.add_stream(beside["arrivals"])
        writer.write_samples(arrivals, time[-1:], np.array([[float(len(time)), float(time[-1])]]))
        notes = writer.add_stream(beside["notes"])
        writer.write_texts(notes, [90.0], [(json.dumps({"event": "begin"}),)])
    return path
