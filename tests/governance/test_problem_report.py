"""A problem report has what explains a fault, and nothing of people in any of its bytes."""

import json
import os
import platform
import random
import re
import runpy
import shutil
import socket
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from faults.sessions import STUDY, finished, kill_all, labcrane, wait_for
from governance.test_commands import Terminal

from labcrane.cli.problem_report import EVENTS, places
from labcrane.core import Event, Finding, Verdict
from labcrane.doctor.report import Check
from labcrane.recording.crash_marker import crash_marker_path, read_crash_marker
from labcrane.recording.journal import Column, SessionJournal
from labcrane.testing import main

FOLDER, PERSON, HOST, USER = "Zwiebel Labor", "QX417", "hexenhaus-7", "qbertuser"
NOTE, AMPLIFIER = "hums a tune", "amplifier-pc-3"
PLANTED = (FOLDER, "zwiebel", PERSON, HOST, USER, NOTE, AMPLIFIER)

FOUND = (
    Check("disk", Finding(Verdict.PASS, f"/home/{USER}/{FOLDER}/data on {HOST} is ext4")),
    Check(f"view {PERSON}", Finding(Verdict.FAIL, f"no {NOTE}", "plug one in")),
    Check("clock", Finding(Verdict.WARN, "the clock source is hpet", "see the kernel's log")),
    Check("scheduling", Finding(Verdict.FAIL, f"PermissionError: /home/{USER}")),
    Check("lsl", Finding(Verdict.PASS, f"stream 'eeg' comes from {AMPLIFIER}")),
)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A computer with planted names, and a doctor that takes no time."""
    folder = tmp_path / FOLDER
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("USER", USER)
    monkeypatch.setattr(platform, "node", lambda: HOST)
    monkeypatch.setattr("labcrane.doctor.checks.examine", lambda *_, **__: FOUND)
    monkeypatch.setattr("labcrane.doctor.checks.left_out", lambda *_: ())
    return folder


def a_protocol(folder: Path) -> Path:
    path = folder / "protocol.yaml"
    people = "participants: {pattern: 'QX[0-9]{3}'}\ntitle:"
    path.write_text(STUDY.format(study="onion").replace("title:", people), encoding="utf-8")
    return path


def a_journal(
    folder: Path, session: int = 1, events: tuple[Event, ...] = (), **context: object
) -> Path:
    path = folder / f"ses-{session:02d}_run.xdf"
    folder.mkdir(parents=True, exist_ok=True)
    with SessionJournal(path, [Column("loop", "tick", "1")], 240.0) as journal:
        for event in (
            Event("session.start", 5.0, {"participant": folder.name, **context}),
            *events,
        ):
            journal.write_event(event, 0)
    return path


def bytes_of(archive: Path) -> bytes:
    with zipfile.ZipFile(archive) as opened:
        inside = [opened.read(name) for name in opened.namelist()]
    return b"\n".join([archive.read_bytes(), *inside]).lower()


def file_of(archive: Path, name: str) -> str:
    with zipfile.ZipFile(archive) as opened:
        return opened.read(name).decode()


def events_of(archive: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in file_of(archive, "session/events.jsonl").splitlines()]


def planted_in(archive: Path) -> list[str]:
    everything = bytes_of(archive)
    also = [name for name in (socket.gethostname(),) if len(name) > 3]
    return [each for each in (*PLANTED, *also) if each.lower().encode() in everything]


def report(*words: object, status: int = 0) -> Path:
    archive = Path("report.zip")
    assert main(["report-problem", "--to", str(archive), *map(str, words)]) == status
    return archive


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A study whose session was killed while it ran."""
    folder = tmp_path_factory.mktemp("killed") / FOLDER
    folder.mkdir()
    words = ("run", a_protocol(folder), "--participant", PERSON, "--simulate")
    finished(labcrane(*words, "--fast", cwd=folder))
    second = labcrane(*words, "--session", 2, cwd=folder)
    journal = folder / "data" / f"{PERSON}-SIMULATED" / "ses-02_run.xdf"
    wait_for(lambda: journal.exists() and b'"trial.start"' in journal.read_bytes())
    wait_for(lambda: read_crash_marker(crash_marker_path(journal)))
    kill_all(second)
    second.communicate(timeout=120)
    yield folder
    shutil.rmtree(folder)


@pytest.mark.slow
def test_nothing_of_people_is_in_any_byte_of_the_report_of_a_killed_session(killed: Path) -> None:
    archive = report("--protocol", killed, "--yes")
    assert planted_in(archive) == []
    about = json.loads(file_of(archive, "session/about.json"))
    assert about["session"] == 2
    assert about["died_in"]["tick"] > 0
    assert about["not_read"] == {}
    names = [each["event"] for each in events_of(archive)]
    assert "trial.start" in names
    assert "session.end" not in names


def test_without_a_terminal_nothing_is_written_unless_yes_is_said(
    capsys: pytest.CaptureFixture[str],
) -> None:
    archive = report(status=2)
    assert "there is no terminal at which to ask; --yes writes it" in capsys.readouterr().err
    assert not archive.exists()
    report("--yes")
    assert os.name != "posix" or archive.stat().st_mode & 0o077 == 0
    assert planted_in(archive) == []
    assert json.loads(file_of(archive, "doctor.json"))["checks"] == [
        {"area": "disk", "verdict": "PASS"},
        {"area": "view", "verdict": "FAIL"},
        {"area": "clock", "verdict": "WARN", "text": "the clock source is hpet"},
        {"area": "scheduling", "verdict": "FAIL"},
        {"area": "lsl", "verdict": "PASS"},
    ]


@pytest.mark.parametrize(("typed", "written"), [("n\n", False), ("y\n", True)])
def test_at_a_terminal_each_file_is_shown_and_then_it_is_asked(
    typed: str,
    written: bool,  # noqa: FBT001 - a parameter of a test
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.stdin", Terminal(typed))
    archive = report()
    said = capsys.readouterr().out
    assert "== README.txt, " in said
    assert '"text": "the clock source is hpet"' in said
    assert "no session: there is no journal below data" in said
    assert ("nothing was written" in said) is not written
    assert archive.exists() is written


def test_a_long_file_is_shown_in_part_and_whole_when_it_is_asked_for(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    many = tuple(Event("break.start", 6.0, {"seconds": 1000 + number}) for number in range(99))
    a_journal(here / "data" / PERSON, events=many)
    report("--yes")
    said = capsys.readouterr().out
    assert "... and 40 lines more; the same command with --show session/events.jsonl" in said
    assert "1098" not in said
    report("--show", "session/events.jsonl")
    assert "1098" in capsys.readouterr().out
    report("--show", "session/frames", status=2)
    assert "the archive has README.txt" in capsys.readouterr().err


def test_the_session_written_last_is_taken_unless_another_one_is_asked_for(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import os

    for session, when in ((1, 3000), (2, 1000)):
        os.utime(a_journal(here / "data" / PERSON, session), (when, when))
    report("--show", "session/about.json")
    assert json.loads(capsys.readouterr().out)["session"] == 1
    report("--show", "session/about.json", "--session", 2, "--data", here / "data" / PERSON)
    said = capsys.readouterr().out
    assert json.loads(said)["session"] == 2
    report("--yes", "--protocol", "protokol.yaml", status=2)
    assert "protokol.yaml: there is no such file" in capsys.readouterr().err
    report("--yes", "--session", 3, status=1)
    assert "there is no journal of session 3 below data; there is 1, 2" in capsys.readouterr().err


def test_only_named_events_go_in_and_only_their_named_fields(here: Path) -> None:
    events = (
        Event("order.note", 6.0, {"text": NOTE}),
        Event("questionnaire.answer", 6.5, {"item": "q1", "value": 4}),
        Event("trial.end", 7.0, {"trial": 1, "outcome": "success", "error": 0.1, "late_ticks": 2}),
        Event("plugin.slow", 8.0, {"why": f"own.py of {USER}", "calls": 4}),
    )
    a_journal(here / "data" / PERSON, events=events)
    archive = report("--yes")
    assert planted_in(archive) == []
    _, trial, slow = events_of(archive)
    assert trial == {"s": 2.0, "tick": 0, "part": 1, "event": "trial.end", "trial": 1} | {
        "late_ticks": 2
    }
    assert slow["calls"] == 4
    assert "why" not in slow
    assert not {"order.note", "questionnaire.answer"} & EVENTS


def test_a_study_that_cannot_be_read_is_reported_with_the_place_of_the_error(here: Path) -> None:
    protocol = a_protocol(here)
    protocol.write_text(protocol.read_text().replace("rate_hz", "rat_hz"), encoding="utf-8")
    archive = report("--protocol", here, "--yes")
    (why,) = json.loads(file_of(archive, "doctor.json"))["failed"]
    assert why[0] == "ProtocolError"
    assert any(re.fullmatch(r"  labcrane/protocol/\w+\.py, line \d+, in \w+", line) for line in why)
    assert planted_in(archive) == []


def test_a_journal_that_cannot_be_read_is_reported_with_the_fault(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(paths: object) -> None:
        raise ZeroDivisionError(f"in {paths}")

    a_journal(here / "data" / PERSON)
    monkeypatch.setattr("labcrane.cli.problem_report.read_journal", fails)
    archive = report("--yes")
    faults = json.loads(file_of(archive, "session/about.json"))["not_read"]
    (what, here_, there) = faults["run"]
    assert what == "ZeroDivisionError"
    assert re.fullmatch(r"  labcrane/cli/problem_report\.py, line \d+, in _read", here_)
    assert there == "  (another)"
    assert "Missing: a journal of the session: run.\n" in file_of(archive, "README.txt")
    assert planted_in(archive) == []


def test_a_file_that_is_there_is_not_overwritten(capsys: pytest.CaptureFixture[str]) -> None:
    Path("report.zip").write_text("kept", encoding="utf-8")
    report("--yes", status=1)
    assert "report.zip is there already; give another name with --to" in capsys.readouterr().err
    assert Path("report.zip").read_text() == "kept"


def drawn(rng: random.Random) -> str:
    """A name as people have them, that nobody has."""
    letters = rng.choices("bcdfghjklmnpqrstvwxz", k=4)
    return "".join(f"{each}{rng.choice('aeiouyäö')}" for each in letters).title()


@pytest.mark.parametrize("seed", range(8))
def test_no_value_planted_in_a_free_text_is_in_any_byte(
    here: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(seed)
    names = [drawn(rng) for _ in range(14)]
    some = {name: {"plugin": name, "use": name} for name in names}
    context = {"rate_hz": names[0], "versions": dict(zip(names, names, strict=True))}
    checks = [{"area": name, "verdict": "WARN", "text": name, "advice": name} for name in names]
    person, other = (f"QX{number}" for number in rng.sample(range(100, 1000), 2))
    why = iter([*names, *names])
    said = (
        f"ValueError: {next(why)} said '{next(why)}, {next(why)}' of {other} in "
        f'/srv/{next(why)} {next(why)}/{next(why).lower()}.py ("{next(why)}")'
    )
    events = (
        Event("session.failed", 6.0, {"why": said}),
        Event("plugin.slow", 6.5, {"why": f"{next(why).lower()} {next(why)}_{next(why)}"}),
        Event("stream.lost", 7.0, {"what": f"{next(why)} EEG"}),
        Event("signal.bad", 7.5, {"stream": next(why), "channel": next(why), "kind": "flat"}),
        Event("feedback.ready", 8.0, {"what": "view", "facts": {next(why): [next(why)]}}),
    )
    doctor = {"at_start": {"checks": checks}}
    a_journal(here / "data" / person, 1, events, **context, components=some, doctor=doctor)
    found = (Check("lsl", Finding(Verdict.FAIL, f"stream {names[0]}", f"ask {names[1]}")),)
    monkeypatch.setattr("labcrane.doctor.checks.examine", lambda *_, **__: found)
    archive = report("--protocol", a_protocol(here), "--data", here / "data", "--yes")
    everything = bytes_of(archive)
    planted = [person, other, *(part for name in names for part in (name, name.lower()))]
    there = [each for each in planted if each.lower().encode() in everything]
    assert there == []
    assert [each["event"] for each in events_of(archive)][1:] == [each.name for each in events]


def test_a_doctor_that_fails_gives_an_archive_that_says_it_is_missing(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise UnicodeDecodeError("utf-8", PERSON.encode(), 0, 1, NOTE)

    monkeypatch.setattr("labcrane.doctor.checks.examine", fails)
    archive = report("--yes")
    said = file_of(archive, "README.txt")
    assert "Missing: what labcrane doctor finds: it failed.\n" in said
    (why,) = json.loads(file_of(archive, "doctor.json"))["failed"]
    assert why[0] == "UnicodeDecodeError"
    assert planted_in(archive) == []


def test_a_class_and_a_function_of_a_study_are_not_named(here: Path) -> None:
    own = here / f"of_{PERSON.lower()}.py"
    own.write_text(
        "class Zwiebel(Exception):\n    pass\n\n"
        f"def of_{USER}():\n    raise Zwiebel('{NOTE}') from OSError('{HOST}')\n"
    )
    space = runpy.run_path(str(own))
    with pytest.raises(Exception, match=NOTE) as caught:
        space[f"of_{USER}"]()
    assert places(caught.value) == ["(another)", "  (another)", "  (another)", "OSError"]
