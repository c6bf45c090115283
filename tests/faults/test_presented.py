"""A view whose window stands still within a movement: that movement is told, and no other one."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
from faults.sessions import unique, wait_for
from needs import GRAPHICS, needs
from simple_crane import FORM
from windows import an_x_server

from labcrane.analysis.cohort import find_cohort
from labcrane.analysis.measures import measure_session
from labcrane.analysis.presented import not_presented
from labcrane.analysis.quality import exclusions, is_result
from labcrane.core.records import Event
from labcrane.launcher.launcher import Launcher
from labcrane.launcher.pages import left_behind
from labcrane.session.commands import Command, Order, QueueConsole
from labcrane.session.visit import visit_of
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
  operator: {{use: view, renderer: software, size: [320, 200], quality: low, shadow: 0}}
presented: {{min_hz: 4, max_gap_s: 1.5}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming, pairs: 1}}
"""
)
"""Its limits are wide: other programs share the test's computer."""


class Stops(QueueConsole):
    """Stops the view's process for a while within the second counted movement."""

    def __init__(self) -> None:
        super().__init__()
        self.began: list[Event] = []
        self.ended = False
        self.listeners.append(self._hear)

    def _hear(self, event: Event) -> None:
        if event.name == "trial.start" and event.data["counted"]:
            self.began.append(event)
        self.ended |= event.name == "session.end"

    def stop_a_view(self) -> tuple[float, float]:
        """Return from when to when it stood still, on the session's clock."""
        wait_for(lambda: len(self.began) == 2 or self.ended)
        (view,) = [
            each
            for each in psutil.Process().children(recursive=True)
            if "labcrane.feedback.process" in each.cmdline()
        ]
        since = self.began[1].time + 0.5
        wait_for(lambda: time.perf_counter() > since)
        began = time.perf_counter()
        view.send_signal(signal.SIGSTOP)
        try:
            wait_for(lambda: time.perf_counter() > began + STILL_S)
        finally:
            over = time.perf_counter()
            view.send_signal(signal.SIGCONT)
        return began, over


@pytest.mark.slow
@needs("Xvfb", *GRAPHICS)
def test_a_window_that_stood_still_for_3_s_leaves_out_that_movement_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Longer than it stands still: a driver that hangs keeps nobody from hearing of its process.
    monkeypatch.setattr("labcrane.feedback.handle.SILENT_S", 60.0)
    protocol, data = tmp_path / "study.yaml", tmp_path / "data"
    protocol.write_text(STUDY.format(study=unique("still")))
    order = visit_of(protocol, "P001", 1, data, simulated=True, feedback=True)
    console, said = Stops(), list[str]()
    with an_x_server() as display, ThreadPoolExecutor(1) as elsewhere:
        monkeypatch.setitem(os.environ, "DISPLAY", display)
        launcher = Launcher(order, console, said.append)
        outcome = elsewhere.submit(launcher.run)
        try:
            began, over = console.stop_a_view()
        except BaseException:
            console.give(Command(Order.END))
            raise
        outcome.result()

    (person,) = find_cohort(data, ["simulated"]).included
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

    page = left_behind(order, launcher.outcome, launcher.sync_report)
    (line,) = [each for each in page.advice if " view: " in each]
    assert f"trial {flagged['trial']:g}: " in line
    assert page.verdict.startswith("The session is complete and saved; movements were not shown")
    assert page.level == "bad"
