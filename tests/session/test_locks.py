"""Two sessions of one participant at once: the second is refused, whoever runs the first."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rehearsal import ScriptedConsole, a_study

from labcrane import RecordingError
from labcrane.files.lock import held
from labcrane.session.session import record, running
from labcrane.testing import Visit, run

HOLDER = """
import sys
from pathlib import Path
from labcrane.files.lock import held
with held(Path(sys.argv[1]), "taken"):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def visit(tmp_path: Path) -> Visit:
    return Visit(a_study(tmp_path), "P001", 1, tmp_path / "data", simulated=True, fast=True)


class Starter(ScriptedConsole):
    """Tries to start a second session in the middle of the first."""

    def __init__(self, second) -> None:
        super().__init__()
        self._second = second
        self.refused = ""

    def commands(self):
        if not self.refused:
            with pytest.raises(RecordingError) as caught:
                self._second()
            self.refused = str(caught.value)
        return []


def test_a_second_run_of_a_participant_is_refused_while_the_first_lasts(visit: Visit) -> None:
    other = replace(visit, session=1)
    room = Starter(lambda: run(other, ScriptedConsole()))
    run(visit, room)
    assert room.refused.startswith(
        "another labcrane is running a session of P001-SIMULATED; wait until it has ended, or end "
        "it, and try again (process "
    )
    assert sorted(path.name for path in visit.folder.path.iterdir()) == [
        "P001-SIMULATED.h5",
        "ses-01_run.xdf",
    ]


def test_a_session_is_not_resumed_while_it_runs(visit: Visit) -> None:
    room = Starter(lambda: run(replace(visit, resumed=True), ScriptedConsole()))
    run(visit, room)
    assert "is running a session of P001-SIMULATED" in room.refused


def test_a_session_process_whose_launcher_died_is_waited_for_and_then_named(
    visit: Visit, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane.session import session

    monkeypatch.setattr(session, "LEAVING_S", 0.2)
    room = Starter(lambda: record(replace(visit, resumed=True), ScriptedConsole()))
    with running(visit):
        record(visit, room)
    assert "is running a session of P001-SIMULATED" in room.refused


def test_a_lock_names_its_process_and_dies_with_it(tmp_path: Path) -> None:
    path = tmp_path / "a.lock"
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        encoding="utf-8",
    )
    assert process.stdout.readline() == "held\n"
    named = rf"^taken \(process {process.pid} holds .*a\.lock\)"
    with pytest.raises(RecordingError, match=named), held(path, "taken"):
        pass
    process.kill()
    process.communicate()
    with held(path, "taken", patience_s=5.0):
        assert path.exists()
    assert not path.exists()
