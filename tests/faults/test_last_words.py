"""Feedback processes that crash or hang when they let go of what they had opened."""

from pathlib import Path

import numpy as np
import psutil
import pytest
from faults.sessions import unique
from faults.test_feedback import runs_feedback
from rehearsal import SHORT

import labcrane as lab
from labcrane import DeviceError
from labcrane.feedback import handle
from labcrane.feedback.processes import FeedbackProcesses
from labcrane.launcher.launcher import Launcher
from labcrane.session.visit import visit_of
from labcrane.testing import QueueConsole, Visit

PLUGIN = '''
import os
import time
from typing import Literal

import numpy as np
from labcrane import DeviceError, Feedback, Settings, Signal, hookimpl, offer


class Library:
    """Ends the process when nobody refers to it any more, as libraries in C++ may."""

    def __del__(self):
        os.abort()


class ClumsySettings(Settings):
    how: Literal["refuses", "raises", "hangs"]


class Clumsy(Feedback):
    signals = (Signal("seen", "1"),)

    def __init__(self, settings):
        self._how, self._seen = settings.how, 0

    def open(self, run):
        if self._how != "hangs":
            library = Library()  # kept by the error's traceback alone
            raise {"refuses": DeviceError, "raises": ValueError}[self._how]("it is broken")

    def present(self, frame):
        self._seen += 1
        return np.array([float(self._seen)])

    def close(self):
        while self._how == "hangs":
            time.sleep(1.0)


@hookimpl
def labcrane_feedback():
    return [offer("clumsy", ClumsySettings, Clumsy)]
'''


def clumsy(folder: Path, how: str) -> Visit:
    """Return a visit whose view is clumsy."""
    (folder / "plugins").mkdir()
    (folder / "plugins" / "clumsy.py").write_text(PLUGIN)
    text = SHORT.replace("study: rehearsal", f"study: {unique('clumsy')}")
    text = text.replace("movements: 2", "movements: 2, limit_s: 0.5")
    protocol = folder / "study.yaml"
    protocol.write_text(f"{text}views:\n  clumsy: {{use: clumsy, how: {how}}}\n")
    return visit_of(protocol, "P001", 1, folder / "data", simulated=True, feedback=True)


@pytest.mark.parametrize(
    ("how", "said"), [("refuses", "it is broken"), ("raises", "ValueError: it")]
)
def test_why_it_cannot_be_started_is_said_before_its_libraries_end_the_process(
    how: str, said: str, tmp_path: Path
) -> None:
    made = FeedbackProcesses(clumsy(tmp_path, how))
    try:
        with pytest.raises(DeviceError, match=f"^feedback 'clumsy' cannot be started: .*{said}"):
            made.wait(lambda said: None, lambda: False)
    finally:
        made.stop()


@pytest.mark.slow
def test_one_that_hangs_when_it_is_closed_is_ended_and_all_it_presented_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(handle, "STOP_S", 0.5)
    said: list[str] = []
    launcher = Launcher(clumsy(tmp_path, "hangs"), QueueConsole(), said.append)
    outcome = launcher.run()
    assert outcome.died is None, said
    assert not any(map(runs_feedback, psutil.Process().children()))
    file = tmp_path / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"
    session = lab.open_recording(file).session(1)
    assert (session.trials["outcome"] != "").all()
    seen = session.streams["labcrane.feedback.clumsy"].data["seen"].to_numpy()
    np.testing.assert_array_equal(seen, np.arange(1.0, len(seen) + 1))
    ticks = session.streams["labcrane.feedback.clumsy"].data["frame.tick"]
    assert ticks.max() == session.streams["loop"].data["tick"].max()
