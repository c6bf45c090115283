"""A view that fails at each attempt is left out, and is started again when a person asks for it."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from faults.sessions import unique, wait_for
from faults.test_feedback import Told, install
from simple_crane import FORM

import labcrane as lab
from labcrane.feedback.handle import ATTEMPTS, SILENT_S
from labcrane.launcher.launcher import Launcher
from labcrane.session.visit import visit_of
from labcrane.testing import Command, Order, QueueConsole

STUDY = (
    """\
labcrane: 1
study: {study}
title: A study whose view needs help
rate_hz: 240
"""
    + FORM
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 1, limit_s: 0.5}}
views:
  slow: {{use: slow, broken: {marker}}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming}}
on_fault: {{feedback_lost: pause}}
"""
)
PLUGIN = '''
import time
from pathlib import Path
import numpy as np
from labcrane import Feedback, Settings, hookimpl, offer


class SlowSettings(Settings):
    broken: str
    """A file; while it is there, no picture can be drawn."""


class Slow(Feedback):
    signals = ()

    def __init__(self, settings):
        self._broken, self._first = Path(settings.broken), True

    def present(self, frame):
        if self._broken.exists():
            raise ValueError("the driver is gone")
        if self._first:  # as on a busy computer
            time.sleep(LONG_S)
        self._first = False
        return np.array([])


@hookimpl
def labcrane_feedback():
    return [offer("slow", SlowSettings, Slow)]
'''


@pytest.mark.slow
def test_a_view_that_was_left_out_is_started_again_and_a_slow_first_picture_does_not_kill_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, "slow", PLUGIN.replace("LONG_S", f"{SILENT_S + 1.5}"))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    protocol, marker = tmp_path / "study.yaml", tmp_path / "broken"
    protocol.write_text(STUDY.format(study=unique("given-up"), marker=marker))
    marker.touch()
    console, said = QueueConsole(), []
    told = Told(console)
    order = visit_of(protocol, "P001", 1, tmp_path / "data", simulated=True, feedback=True)
    with ThreadPoolExecutor(1) as elsewhere:
        outcome = elsewhere.submit(Launcher(order, console, said.append).run)
        try:
            wait_for(
                lambda: any("left out" in line for line in said) or outcome.done(), patience_s=60
            )
            marker.unlink()
            console.give(Command(Order.AGAIN, "slow"))
            wait_for(lambda: told.count("feedback.ready") or outcome.done(), patience_s=240)
        except BaseException:
            console.give(Command(Order.END))
            raise
    assert outcome.result().died is None, said
    session = lab.open_recording(order.folder.participant_file).session(1)
    events = session.events
    lost = [data for name, data in zip(events["name"], events["data"], strict=True)
            if name == "feedback.lost"]  # fmt: skip
    assert all("the driver is gone" in each["why"] for each in lost)
    assert [each["left_out"] for each in lost] == [False] * (ATTEMPTS - 1) + [True]
    assert [each["attempt"] for each in lost] == [*range(2, ATTEMPTS + 1), 0]
    names = events["name"].tolist()
    assert names.index("order.again") < names.index("feedback.ready") < names.index("pause.end")
    assert session.trials["outcome"].isin(["success", "timeout"]).all()
