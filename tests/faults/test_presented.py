"""A view whose window stands still within a movement: that movement is told, and no other one."""

import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import psutil
import pytest
from faults.sessions import unique, wait_for
from needs import GRAPHICS, needs
from simple_crane import FORM
from windows import an_x_server

from labcrane.analysis import find_cohort
from labcrane.analysis.measures import measure_session
from labcrane.analysis.presented import PresentedLimits, not_presented
from labcrane.analysis.quality import exclusions, is_result
from labcrane.core import Event
from labcrane.launcher.launcher import Launcher
from labcrane.launcher.pages import left_behind
from labcrane.session.visit import visit_of
from labcrane.streams.recorder.process import STATUS_S
from labcrane.testing import Command, Order, QueueConsole, Visit
from labcrane.web.control_room.condition import ExpectedSession, Lamp, lamp_of
from labcrane.web.state import SessionView
from labcrane_tables.settings import TableSettings
from labcrane_tables.tables import Tables

STILL_S = 3.0
STUDY = (
    """\
labcrane: 1
study: {study}
title: A study whose window stands still
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 3}}
views:
  operator: {{use: view, renderer: software, size: [320, 200], quality: low, shadow: 0{more}}}
presented: {{min_hz: {least}, max_gap_s: 1}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, pairs: 1}}
"""
)
"""Its limits are wide: other programs share the test's computer."""


class Punctual:
    """Frames that come in time."""

    silent_s = 0.0
    lateness_s = None


class Examiner(QueueConsole):
    """Harms the view's process within the second counted movement, and looks at the lamp."""

    launcher: Launcher

    def __init__(self) -> None:
        super().__init__()
        self.began: list[Event] = []
        self.ended = False
        self.lamps: list[Lamp] = []
        self._view = SessionView()
        self.listeners += [self._hear, self._view.take]

    def _hear(self, event: Event) -> None:
        if event.name == "trial.start" and event.data["counted"]:
            self.began.append(event)
        self.ended |= event.name == "session.end"

    def looks(self) -> None:
        self._view.hear_of_streams(self.launcher.streams_status)
        limits = PresentedLimits(min_hz=1.0, max_gap_s=1.0)
        expected = ExpectedSession(1 / 240, ["operator"], limits)
        self.lamps.append(lamp_of(self._view, Punctual(), expected))

    def passed(self, until: float) -> bool:
        self.looks()
        return time.perf_counter() > until

    def view(self) -> psutil.Process:
        """Return the view's process, half a second into the second counted movement."""
        wait_for(lambda: len(self.began) == 2 or self.ended)
        found = [
            each
            for each in psutil.Process().children(recursive=True)
            if "labcrane.feedback.process" in each.cmdline()
        ]
        wait_for(lambda: self.passed(self.began[1].time + 0.5))
        return found[0]

    def stop_a_view(self) -> tuple[float, float]:
        """Return from when to when it stood still, on the session's clock."""
        view, began = self.view(), time.perf_counter()
        view.send_signal(signal.SIGSTOP)
        try:
            wait_for(lambda: self.passed(began + STILL_S))
        finally:
            over = time.perf_counter()
            view.send_signal(signal.SIGCONT)
        wait_for(lambda: self.passed(over + STATUS_S))  # the recorder's last word of it
        return began, over

    def kill_a_view(self) -> None:
        self.view().kill()


def run_in_a_window(
    folder: Path, console: Examiner, does: Callable[[], Any], more: str = "", least: int = 1
) -> tuple[Visit, Any]:
    """Run a simulated session whose view is in a real window; return what ``does`` returned."""
    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study=unique("still"), more=more, least=least))
    order = visit_of(protocol, "P001", 1, folder / "data", simulated=True, feedback=True)
    with (
        an_x_server() as display,
        ThreadPoolExecutor(1) as elsewhere,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setitem(os.environ, "DISPLAY", display)
        console.launcher = Launcher(order, console, lambda _: None)
        outcome = elsewhere.submit(console.launcher.run)
        try:
            done = does()
        except BaseException:
            console.give(Command(Order.END))
            raise
        outcome.result()
    return order, done


@pytest.mark.slow
@needs("Xvfb", *GRAPHICS)
def test_a_window_that_stood_still_for_3_s_leaves_out_that_movement_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Longer than it stands still: a driver that hangs keeps nobody from hearing of its process.
    monkeypatch.setattr("labcrane.feedback.handle.SILENT_S", 60.0)
    console = Examiner()
    order, (began, over) = run_in_a_window(tmp_path, console, console.stop_a_view)
    red = {lamp.reason for lamp in console.lamps if lamp.level == "bad"}
    assert red <= {
        f"the operator's view operator has shown no picture for {s} s" for s in (1, 2, 3)
    }
    assert red, "the lamp tells of it while it stands still"

    (person,) = find_cohort(tmp_path / "data", ["simulated"]).included
    _, session = next(person.sessions())
    table = measure_session(session).assign(participant="P001", session=1)
    (flagged,) = table[not_presented(table)].to_dict("records")
    assert flagged["started"] < began < over < flagged["ended"]
    assert flagged["trial"] == console.began[1].data["trial"]

    shown = session.streams["labcrane.feedback.operator"].data["flip.time"].to_numpy()
    assert not ((shown > began + 0.1) & (shown < over)).any()
    gap = shown[shown > over - 0.01][0] - shown[shown < began + 0.1][-1]
    assert STILL_S - 0.1 < gap == pytest.approx(flagged["longest_without_picture"], abs=0.1)
    within = (shown >= flagged["started"]) & (shown <= flagged["ended"])
    assert flagged["pictures"] == pytest.approx(np.count_nonzero(within), abs=1)
    assert set(table["feedback_lost"]) == {0.0}  # nobody was told: the process lived

    (left_out,) = exclusions(table).to_dict("records")
    assert left_out["why"].endswith(f", none for {flagged['longest_without_picture']:.2f} s")
    assert is_result(table).sum() == len(table) - 1
    (tmp_path / "export").mkdir()
    Tables(TableSettings()).export(iter([person]), tmp_path / "export")
    exported = pd.read_csv(tmp_path / "export" / "trials.csv")
    assert exported["presentation_failed"].tolist() == table["presentation_failed"].tolist()
    assert exported["longest_without_picture"].max() == flagged["longest_without_picture"]

    page = left_behind(order, console.launcher.outcome, console.launcher.sync_report)
    (line,) = [each for each in page.advice if " feedback: " in each]
    assert f"trial {flagged['trial']:g}: " in line
    assert page.verdict.startswith(
        "The session is complete and saved; the operator saw or heard too little"
    )
    assert page.level == "bad"


@pytest.mark.long
@needs("Xvfb", *GRAPHICS)
def test_a_window_that_was_killed_is_lost_until_it_shows_again(tmp_path: Path) -> None:
    console = Examiner()
    run_in_a_window(tmp_path, console, console.kill_a_view)
    (person,) = find_cohort(tmp_path / "data", ["simulated"]).included
    _, session = next(person.sessions())
    table = measure_session(session)
    harmed = table.iloc[1]
    assert harmed["presentation_failed"] == 1.0
    events = session.events
    lost, ready = (
        events.loc[events["name"] == f"feedback.{name}", "time"].to_numpy()[-1]
        for name in ("lost", "ready")
    )
    within = min(ready, harmed["ended"]) - lost
    assert harmed["feedback_lost"] == pytest.approx(within, abs=0.02)
    missed = table[(table["started"] < ready) & (table["ended"] > lost)]
    assert not_presented(table).sum() <= len(missed)
    assert not not_presented(table.drop(missed.index)).any()


@pytest.mark.long
@needs("Xvfb", *GRAPHICS)
def test_a_window_that_shows_5_pictures_a_second_leaves_out_every_movement(tmp_path: Path) -> None:
    console = Examiner()
    run_in_a_window(tmp_path, console, lambda: None, ", rate_hz: 5", least=8)
    (person,) = find_cohort(tmp_path / "data", ["simulated"]).included
    _, session = next(person.sessions())
    table = measure_session(session)
    seconds = table["ended"] - table["started"]
    assert not_presented(table).all()
    assert (table["pictures"] / seconds).between(3.0, 5.5).all()
