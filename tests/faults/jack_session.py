"""A session whose sound is played by a JACK server of its own."""

from pathlib import Path

import pytest
from jack_server import a_jack_server, underruns

from labcrane import open_recording
from labcrane.launcher.launcher import Launcher
from labcrane.recording import SessionRecord
from labcrane.session.visit import visit_of
from labcrane.testing import QueueConsole


class Examiner(QueueConsole):
    """Gives orders as the session goes on, and can ask its launcher."""

    launcher: Launcher


def a_jack_session(
    protocol: str, folder: Path, examiner: Examiner, *, real_time: bool = False
) -> tuple[SessionRecord, list[str]]:
    """Run a simulated session; return its record, and what the server complained of."""
    path = folder / "study.yaml"
    path.write_text(protocol)
    order = visit_of(path, "P001", 1, folder / "data", simulated=True, feedback=True)
    said: list[str] = []
    with (
        a_jack_server(folder, real_time=real_time) as (name, log),
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setenv("JACK_DEFAULT_SERVER", name)
        examiner.launcher = Launcher(order, examiner, said.append)
        outcome = examiner.launcher.run()
    assert outcome.died is None, said
    recording = folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"
    return open_recording(recording).session(1), underruns(log)
