"""Frames and events while the disk refuses them, and events that no journal can hold."""

from pathlib import Path

import numpy as np
import pytest

from labcrane import Frame, PluginError, RecordingError, Tick
from labcrane.core import Event
from labcrane.recording.frame_log import FrameLog, columns
from labcrane.recording.journal import SessionJournal
from labcrane.recording.journal_reader import SessionLog, read_journal
from labcrane.registry.call_monitor import CallMonitor, Overrun
from labcrane.session.overruns import FEW, OverrunReporter
from labcrane.testing import RATE_HZ, ch8, make_frame, make_run

RUN = make_run(ch8())


class FillingJournal(SessionJournal):
    """A journal on a disk that is full for a while."""

    full = False

    def write_event(self, event: Event, tick: int) -> None:
        if self.full:
            raise RecordingError("no space left")
        super().write_event(event, tick)


@pytest.fixture
def journal(tmp_path: Path) -> FillingJournal:
    return FillingJournal(tmp_path / "ses-01_run.xdf", columns(RUN), RATE_HZ)


def frame_with(*events: Event) -> Frame:
    frame = make_frame(RUN)
    frame.events = events
    return frame


def written(journal: SessionJournal) -> SessionLog:
    log, (state,) = read_journal([journal.path])
    assert state.notes == []
    return log


def test_an_event_that_no_journal_can_hold_costs_none_of_those_behind_it(
    journal: FillingJournal,
) -> None:
    log = FrameLog(journal, RUN)
    bad, good = Event("lamp.lit", 1.0, {"tick": 3}), Event("trial.end", 1.0, {"trial": 1})
    with pytest.raises(PluginError, match=r"'lamp.lit' has data called tick"):
        log.write(frame_with(bad, good))
    log.close()
    assert [event.name for event in written(journal).events] == ["trial.end"]


def test_a_slow_component_is_told_of_when_the_disk_has_room_again(journal: FillingJournal) -> None:
    class Deaf:
        def commands(self) -> list[object]:
            return []

        def report(self, event: Event) -> None:
            pass

    log, call_monitor = FrameLog(journal, RUN), CallMonitor()
    slowness = OverrunReporter(call_monitor, RATE_HZ, log, Deaf())
    call_monitor.overruns["scheme"] = Overrun(calls=FEW + 1, worst_s=0.05)
    journal.full = True
    frame = frame_with()
    frame.tick = Tick(7, 1.0, 1.0)
    slowness(frame)
    assert log.trouble == "no space left"
    journal.full = False
    log.write(frame_with())
    assert log.trouble is None
    log.close()
    found = written(journal)
    assert [(event.name, event.tick) for event in found.events] == [("plugin.slow", 7.0)]
    assert len(np.asarray(found.time)) == 1
