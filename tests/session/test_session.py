"""A whole session: what it leaves behind, and what is said when it cannot run."""

import gc
import hashlib
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cranes import ENGINES
from left_out import as_in_a_program
from programs import ran
from rehearsal import SHORT, ScriptedConsole, a_study, rehearse
from virtual_sticks import desk

import labcrane
from labcrane import PluginError, ProtocolError, RecordingError
from labcrane.core import Event
from labcrane.protocol.rig import Rig
from labcrane.testing import Visit, run

ROOT = Path(__file__).parents[2]


@pytest.fixture
def visit(tmp_path: Path) -> Visit:
    study = a_study(tmp_path)
    return Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)


def test_the_participant_file_holds_every_frame_and_event(visit: Visit) -> None:
    seen = rehearse(visit.study)
    session = labcrane.open_recording(run(visit, ScriptedConsole())).session(1)
    state = session.streams["state"].data.to_numpy()
    np.testing.assert_array_equal(state, [frame.state for frame in seen.frames])
    axes = session.streams["input"].data.to_numpy()
    np.testing.assert_array_equal(axes, [frame.axes for frame in seen.frames])
    assert session.events["name"].tolist() == ["session.start", *seen.names]
    assert len(session.trials) == 2


@pytest.mark.slow
def test_ticks_do_not_search_what_was_there_before_them_for_garbage(visit: Visit) -> None:
    class Looking(ScriptedConsole):
        def report(self, event: Event) -> None:
            left_out.append(gc.get_freeze_count())
            super().report(event)

    left_out: list[int] = []
    with as_in_a_program():
        run(visit, Looking())
        assert min(left_out) > 100_000, "all modules"
        assert gc.get_freeze_count() == 0


def test_the_participant_file_tells_everything_about_its_making(visit: Visit) -> None:
    session = labcrane.open_recording(run(visit, ScriptedConsole())).session(1)
    assert session.protocol == SHORT
    assert session.attrs["protocol_sha256"] == hashlib.sha256(SHORT.encode()).hexdigest()
    assert session.attrs["simulated"] == "yes"
    assert session.attrs["pilot"] == "no"
    context = session.context
    assert context["versions"]["labcrane"] == labcrane.__version__
    assert context["components"]["dynamics"]["use"] == "kinematic_crane"
    assert context["components"]["tasks.aiming"]["settings"]["width"] == 0.5
    assert "joints:" in context["machine"]
    units = session.streams["state"].units
    assert units["joint.angle.slew"] == "rad"
    assert units["tip.velocity.x"] == "m/s"


def test_versions_are_of_the_plugins_that_can_be_imported_when_a_session_begins(
    visit: Visit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "site"
    information = place / "late-7.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: late\nVersion: 7\n")
    (information / "entry_points.txt").write_text("[labcrane]\nlate = late\n")
    (place / "late.py").touch()
    found = []
    for path in ([], [str(place)], []):
        with monkeypatch.context() as here:
            here.setattr(sys, "path", [*path, *sys.path])
            again = Visit(
                visit.study, "P001", 1, tmp_path / f"{len(found)}", simulated=True, fast=True
            )
            session = labcrane.open_recording(run(again, ScriptedConsole())).session(1)
        found.append(session.context["versions"].get("late"))
    assert found == [None, "7", None]


@pytest.mark.slow
def test_a_session_is_never_run_twice(visit: Visit) -> None:
    path = run(visit, ScriptedConsole())
    before = path.read_bytes()
    with pytest.raises(
        ProtocolError,
        match=r"P001-SIMULATED has already completed session 1 .*; check the number; the "
        r"study has no further session: use another --participant",
    ):
        run(visit, ScriptedConsole())
    assert path.read_bytes() == before


def test_pilots_and_simulations_have_files_of_their_own(visit: Visit) -> None:
    names = {
        replace(visit, simulated=simulated, pilot=pilot).folder.participant_file.name
        for simulated in (False, True)
        for pilot in (False, True)
    }
    assert names == {"P001.h5", "P001-PILOT.h5", "P001-SIMULATED.h5", "P001-PILOT-SIMULATED.h5"}
    path = run(replace(visit, pilot=True), ScriptedConsole())
    assert labcrane.open_recording(path).session(1).attrs["pilot"] == "yes"


def test_a_session_that_the_protocol_does_not_have_is_refused(visit: Visit) -> None:
    with pytest.raises(ProtocolError, match=r"there is no session 2; .* has 1 'only'"):
        run(replace(visit, session=2), ScriptedConsole())


def test_a_data_folder_that_cannot_be_written_is_refused(visit: Visit, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(
        RecordingError,
        match=r"data folder .* cannot be written: (Not a directory|Path not found); give another",
    ):
        run(replace(visit, data=tmp_path / "file"), ScriptedConsole())


def test_a_component_that_raises_leaves_what_was_recorded(
    visit: Visit, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane_bullet.kinematic_crane import KinematicCrane

    steps = [0]
    step = KinematicCrane.step

    def fails(self, command, dt):
        steps[0] += 1
        if steps[0] == 500:
            raise ZeroDivisionError("a bug in a plugin")
        return step(self, command, dt)

    monkeypatch.setattr(KinematicCrane, "step", fails)
    with pytest.raises(
        PluginError,
        match=r"^dynamics 'kinematic_crane' of plugin 'bullet', in step\(\) .* raised "
        r"ZeroDivisionError: a bug in a plugin \(.*test_session\.py:\d+\) in tick 499",
    ):
        run(visit, ScriptedConsole())
    session = labcrane.open_recording(visit.folder.participant_file).session(1)
    assert len(session.streams["state"].time) == 499


PROGRAM = """
import json, sys
from pathlib import Path
from labcrane.cli.app import main
sys.exit(main(json.loads(sys.argv[1])))
"""


def labcrane_process(*arguments: str) -> subprocess.CompletedProcess[str]:
    return ran([sys.executable, "-c", PROGRAM, json.dumps(arguments)])


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_two_fast_runs_in_two_processes_give_the_same_bits(name: str, tmp_path: Path) -> None:
    study = tmp_path / "study.yaml"
    study.write_text(SHORT.replace("kinematic_crane", name), encoding="utf-8")
    digests = []
    for data in ("one", "two"):
        arguments = ["run", str(study), "--participant", "P001", "--simulate", "--fast"]
        done = labcrane_process(*arguments, "--data", str(tmp_path / data))
        assert done.returncode == 0, done.stderr
        path = tmp_path / data / "P001-SIMULATED" / "P001-SIMULATED.h5"
        state = labcrane.open_recording(path).session(1).streams["state"].data
        digests.append(hashlib.sha256(state.to_numpy().tobytes()).hexdigest())
    assert digests[0] == digests[1]


@pytest.mark.slow
def test_another_process_sees_the_streams_and_their_samples_are_the_files(tmp_path: Path) -> None:
    text = SHORT.replace("study: rehearsal", f"study: s{os.getpid()}")
    study = a_study(tmp_path, text.replace("movements: 2", "movements: 1, limit_s: 2"))
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True)
    source = f"labcrane/{visit.source}"
    assert source.startswith(f"labcrane/s{os.getpid()}/P001-SIMULATED/ses-01/")
    # Whatever the consumer hears once it is connected must be in the file; it asks for so many.
    counts = {"state": 300, "input": 300, "markers": 2}
    asked = [
        part for name, count in counts.items() for part in (f"{source}/labcrane.{name}", str(count))
    ]
    consumer = [sys.executable, str(ROOT / "tests" / "streams" / "consumer.py"), *asked]
    with subprocess.Popen(consumer, stdout=subprocess.PIPE, encoding="utf-8") as heard_by:
        path = run(visit, ScriptedConsole())
        assert heard_by.stdout.readline() == "ready\n"
        heard = json.loads(heard_by.stdout.readline())
    session = labcrane.open_recording(path).session(1)
    for name in ("state", "input"):
        stream = session.streams[name]
        got = heard[f"{source}/labcrane.{name}"]
        rows = dict(zip(stream.time, stream.data.to_numpy().tolist(), strict=True))
        assert len(got["stamps"]) >= 300
        assert all(rows[t] == s for t, s in zip(got["stamps"], got["samples"], strict=True))
    events = {(t, n) for t, n in zip(session.events["time"], session.events["name"], strict=True)}
    markers = heard[f"{source}/labcrane.markers"]
    told = {
        (t, json.loads(s[0])["event"])
        for t, s in zip(markers["stamps"], markers["samples"], strict=True)
    }
    assert len(told) >= 2
    assert told <= events


def test_two_sticks_drive_a_trial_are_unplugged_and_plugged_in_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through SDL's own event path, with a hand that closes the loop on the virtual sticks."""
    monkeypatch.setenv("LABCRANE_CONFIG", str(tmp_path))
    study = a_study(tmp_path, SHORT)
    people = Rig.build(study, simulated=False)
    hand = Rig.build(study, simulated=True).input
    with desk() as table:
        sticks = {"left": table.plug(), "right": table.plug()}
        device = people.input
        columns = labcrane.core.Layout("sticks", device.signals).columns
        read = device.read

        def hand_and_read(tick, seen):
            axes = hand.read(tick, seen)
            wanted = dict(
                zip(labcrane.core.Layout("hand", hand.signals).columns, axes, strict=True)
            )
            for side, stick in sticks.items():
                if stick is not None:
                    for number, axis in enumerate(("x", "y")):
                        stick.move(number, round(32767 * wanted[f"{side}.{axis}"]))
            if tick.number == 400:
                sticks["left"].unplug()
                sticks["left"] = None
            if tick.number == 700:
                sticks["left"] = table.plug()
            return read(tick, seen)

        monkeypatch.setattr(device, "read", hand_and_read)
        monkeypatch.setattr(device, "open", _opens_both(device.open, hand))
        monkeypatch.setattr(device, "begin_trial", hand.begin_trial)
        seen = rehearse(study, rig=people)
    lost, back = seen.events("input.lost"), seen.events("input.back")
    assert lost[0].time == seen.frames[400].tick.due
    assert "left" in lost[0].data["why"]
    assert back[0].time == seen.frames[700].tick.due
    drive = seen.run.command.find("command")
    assert seen.frames[399].command[drive].any()
    for frame in seen.frames[400:700]:
        assert frame.paused
        assert not frame.command[drive].any()
        assert frame.axes[columns.index("left.connected")] == 0.0
    assert all(trial["outcome"] == "success" for trial in seen.trials())


def _opens_both(open_device, hand):
    def both(run):
        hand.open(run)
        open_device(run)

    return both
