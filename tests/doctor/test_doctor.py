"""The whole examination: plugins in processes of their own, the command, and the record."""

import json
import platform
import threading
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from rehearsal import SHORT, ScriptedConsole

import labcrane
from labcrane import RecordingError
from labcrane.core import Finding, Verdict
from labcrane.doctor import check_process, components
from labcrane.doctor.checks import examine, keep_apart
from labcrane.doctor.components import ExaminedPart, of_everything, of_study, unexamined
from labcrane.doctor.report import Check, diagnosis, keep, latest
from labcrane.processes.handle import ProcessHandle
from labcrane.testing import Command, Order, Visit, discover, load, main, run

AIMING = Path(__file__).parents[2] / "protocols" / "aiming" / "protocol.yaml"

LAMP = '''
import os, sys, time
from labcrane import Settings, hookimpl, offer
from labcrane.core import Finding, Verdict

class LampSettings(Settings):
    does: str = "nothing"
    """What its examination does."""

def examine(settings, ask):
    if settings.does == "exits":
        sys.stderr.write("lamp: burnt out\\n")
        sys.stderr.flush()
        os._exit(3)
    if settings.does == "hangs":
        time.sleep(60)
    if settings.does == "raises":
        raise OSError("no lamp")
    return [Finding(Verdict.PASS, "the lamp is lit")]

@hookimpl
def labcrane_feedback():
    return [offer("lamp", LampSettings, lambda settings, machine: None, examine)]
'''


LINE = 1 + LAMP.splitlines().index("        time.sleep(60)")
"""Where the lamp stands still."""


@pytest.fixture
def lamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> type[labcrane.Settings]:
    """A plugin whose examination does what its settings say."""
    (tmp_path / "labcrane_doctors_lamp.py").write_text(LAMP)
    metadata = tmp_path / "labcrane_doctors_lamp-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: labcrane-doctors-lamp\nVersion: 1\n"
    )
    (metadata / "entry_points.txt").write_text("[labcrane]\ndoctors_lamp = labcrane_doctors_lamp\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # of the process that looks
    looks, _ = of_everything(discover())
    (found,) = [look for look in looks if look.name == "lamp"]
    return type(found.settings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("does", "verdict", "text"),
    [
        ("nothing", Verdict.PASS, "the lamp is lit"),
        ("raises", Verdict.FAIL, "examining feedback 'lamp' raised OSError: no lamp"),
        (
            "exits",
            Verdict.FAIL,
            "examining feedback 'lamp' ended its process with exit code 3; "
            "its last output was 'lamp: burnt out'",
        ),
        (
            "hangs",
            Verdict.FAIL,
            "examining feedback 'lamp' did not answer within 8 s; it "
            f"was stuck in examine() (labcrane_doctors_lamp.py:{LINE})",
        ),
    ],
)
def test_a_plugins_look_cannot_harm_the_doctor(
    lamp: type[labcrane.Settings],
    monkeypatch: pytest.MonkeyPatch,
    does: str,
    verdict: Verdict,
    text: str,
) -> None:
    monkeypatch.setattr(check_process, "WAIT_S", 8.0 if does == "hangs" else 30.0)
    look = ExaminedPart("feedback lamp", "feedback", "lamp", lamp.model_validate({"does": does}))
    (found,) = components.examine(look, move=False)
    assert (found.verdict, found.text) == (verdict, text)


SITE = """
import shutil, time
def disk_usage(path):
    time.sleep(600)
shutil.disk_usage = disk_usage
"""
"""What makes every process that starts stand still where it looks at a folder's server."""


@pytest.mark.slow
def test_a_data_folder_that_hangs_is_named_and_the_rest_is_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text(SITE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(check_process, "WAIT_S", 4.0)
    (tmp_path / "study.yaml").write_text(SHORT)
    registry = discover()
    study = load(tmp_path / "study.yaml", registry)
    checks = list(examine(tmp_path, registry, study, peers=["127.0.0.1"]))
    (hung,) = [check.finding for check in checks if check.area == "disk"]
    assert hung.verdict is Verdict.FAIL
    assert hung.text.startswith(
        f"examining folder {tmp_path} did not answer within 4 s; it was stuck in disk_usage() "
        "(sitecustomize.py:4), called by _space() (disk.py:"
    )
    assert "mount it again, or give --data" in hung.advice
    areas = {check.area for check in checks}
    assert {"clock", "scheduling", "input dual_joystick", "lsl", "lsl 127.0.0.1"} < areas


def still(*_: object) -> list[Finding]:
    """Stand still."""
    time.sleep(600.0)
    return []


@pytest.mark.parametrize(
    "place",
    ["clock.examine", "scheduling.examine", "disk.examine", "lsl.examine", "lsl.ask_peer"],
)
def test_no_examination_is_made_in_the_doctors_own_process(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, _, function = place.partition(".")
    monkeypatch.setattr(f"labcrane.doctor.{module}.{function}", still)
    made = []

    def noted(call: check_process.Call, **_: object) -> list[Finding]:
        made.append(getattr(call, "function", None))
        return []

    monkeypatch.setattr(check_process, "examine", noted)
    (tmp_path / "study.yaml").write_text(SHORT)
    registry = discover()
    study = load(tmp_path / "study.yaml", registry)
    list(examine(tmp_path, registry, study, peers=["127.0.0.1"]))
    assert still in made


def test_a_process_that_cannot_be_ended_keeps_the_doctor_no_longer_than_its_patience(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    released, stop = threading.Event(), ProcessHandle.stop

    def late(self: ProcessHandle) -> int:
        released.wait()
        return stop(self)

    monkeypatch.setattr(ProcessHandle, "stop", late)
    monkeypatch.setattr(check_process, "END_S", 0.1)
    try:
        found = keep_apart(diagnosis([]), tmp_path)
        assert found.text.startswith(f"saved in {tmp_path}")
    finally:
        released.set()


def test_a_diagnosis_that_cannot_be_kept_is_told(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("no folder")
    found = keep_apart(diagnosis([]), tmp_path / "data")
    assert found.verdict is Verdict.FAIL
    assert found.text.startswith(f"examining folder {tmp_path / 'data'} raised StorageError: ")


def test_a_study_needs_looks_at_what_it_uses_and_at_nothing_else() -> None:
    registry = discover()
    looks = of_study(load(AIMING, registry), registry)
    assert [look.area for look in looks] == [
        "input dual_joystick",
        "feedback tone",
        "view operator",
        "view examiner",
    ]
    everything, left_out = of_everything(registry)
    assert {"dual_joystick", "sonification", "view"} <= {look.name for look in everything}
    films = ("capture camera", "capture microphone", "capture screen")  # they need their consent
    alone = ("input can", *films, "feedback vibration")  # the others need an address
    assert left_out == [f"{name}: give --protocol with a study that uses it" for name in alone]


def test_a_study_that_films_needs_a_look_at_each_of_its_recordings(tmp_path: Path) -> None:
    registry, protocol = discover(), tmp_path / "protocol.yaml"
    face, room = "{use: camera, device: d, consent: a}", "{use: microphone, device: e, consent: b}"
    protocol.write_text(f"{SHORT}\nrecordings: {{face: {face}, room: {room}}}\n")
    areas = [look.area for look in of_study(load(protocol, registry), registry)]
    assert areas[-2:] == ["recording face", "recording room"]


def test_a_device_that_no_plugin_can_look_at_is_named(tmp_path: Path) -> None:
    registry = discover()
    assert not unexamined(load(AIMING, registry))
    protocol = tmp_path / "protocol.yaml"
    protocol.write_text(SHORT.replace("{use: dual_joystick}", "{use: simulated_operator}", 1))
    (line,) = unexamined(load(protocol, registry))
    assert line.startswith("input simulated_operator: plugin 'operator' has no examine")


def test_the_doctor_takes_a_study_as_argument_or_option_and_not_as_both(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "protocol.yaml").write_text(SHORT)
    folder = str(tmp_path)
    assert main(["doctor", folder, "--protocol", folder]) == 2
    assert "the study was given twice" in " ".join(capsys.readouterr().err.split())
    assert main(["doctor", folder, "--display"]) == 0
    assert "protocol.yaml has no views" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_the_command_says_all_as_json_and_keeps_it_for_the_record(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "protocol.yaml").write_text(SHORT)
    folder = str(tmp_path)  # or the file
    status = main(["doctor", "--protocol", folder, "--json", "--local"])
    said = json.loads(capfd.readouterr().out)
    areas = {check["area"] for check in said["checks"]}
    assert areas == {
        "version", "clock", "scheduling", "screen", "disk", "scheme", "input dual_joystick", "lsl",
    }  # fmt: skip
    failed = [check for check in said["checks"] if check["verdict"] == "FAIL"]
    assert all(check["advice"] for check in failed)
    assert (status == 1) == bool(failed)
    assert any("two joysticks" in check["text"] for check in failed)

    study = load(tmp_path / "protocol.yaml", discover())
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=False)
    file = run(visit, ScriptedConsole({3: [Command(Order.END)]}))
    context = labcrane.open_recording(file).session(1).context
    assert context["doctor"]["examination"] == said
    at_start = context["doctor"]["at_start"]
    assert at_start["computer"] == platform.node()
    assert {check["area"] for check in at_start["checks"]} == {"clock", "scheduling", "disk"}


def test_only_a_diagnosis_of_this_computer_and_of_the_last_day_counts(tmp_path: Path) -> None:
    assert latest(tmp_path) is None
    made = diagnosis([Check("lamp", Finding(Verdict.PASS, "the lamp is lit"))])
    path = keep(made, tmp_path)
    now = datetime.now(UTC)
    assert latest(tmp_path, now + timedelta(hours=23)) == made.as_data()
    assert latest(tmp_path, now + timedelta(hours=25)) is None
    path.write_text(path.read_text().replace(f'"{platform.node()}"', '"another"'))
    assert latest(tmp_path, now) is None
    path.write_text("{}")
    with pytest.raises(RecordingError, match=r"contains no diagnosis .* run labcrane doctor again"):
        latest(tmp_path)
