"""The commands about people, as the examiner types them, with real processes."""

import io
import json
import subprocess
import sys
from pathlib import Path

import pytest
from governed import GOVERNED, TODAY, put_stand_in
from programs import ran

import labcrane
from labcrane.participants.folders import Places
from labcrane.participants.register import Entry, changed
from labcrane.testing import main


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(GOVERNED, encoding="utf-8")
    put_stand_in(tmp_path)
    (tmp_path / "consent.txt").write_text("I take part.\n", encoding="utf-8")
    return tmp_path


def say(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0) -> str:
    assert main(arguments) == status
    said = capsys.readouterr()
    return " ".join((said.out + said.err).split())


def approve(capsys: pytest.CaptureFixture[str]) -> str:
    return say(
        capsys, "approve", "study.yaml", "--board", "Ethics board", "--reference", "KB-1",
        "--valid-until", f"{TODAY.year + 1}-12-31", "--consent", "consent.txt",
    )  # fmt: skip


def run_session(said: str) -> subprocess.CompletedProcess[str]:
    run = ["run", "study.yaml", "--participant", "P001", "--local", "--no-page"]
    return ran([sys.executable, "-m", "labcrane", *run], input=said)


@pytest.mark.slow
def test_from_approval_to_erasure(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "approved until" in approve(capsys)
    refused = run_session("")
    assert refused.returncode == 2
    assert "P001 has not consented to consent.txt" in refused.stderr
    assert "slot 1, seed" in say(capsys, "consent", "study.yaml", "P001")
    done = run_session("note hello\nend\n")
    assert done.returncode == 0, done.stderr
    session = labcrane.open_recording("data/P001/P001.h5").session(1)
    assert session.attrs["approval"] == "KB-1"
    assert "session ended early" in say(capsys, "deviations")
    assert session.attrs["started"][:10] in say(capsys, "participants")
    say(capsys, "note", "P001", "left-handed")
    assert "P001: left-handed" in say(capsys, "participants")
    Path("store").mkdir()
    assert "2 files are equal on both sides" in say(capsys, "transfer", "store")
    assert "P001 is P003 now" in say(capsys, "relabel", "P001", "P003")
    assert "wrong" in say(capsys, "deviations")
    say(
        capsys, "export", "data", "--to", "tables", "--out", "data/exports/tables",
        "--include", "half-finished",
    )  # fmt: skip
    exported = "".join(
        path.read_text(encoding="utf-8") for path in Path("data/exports/tables").rglob("*.csv")
    )
    assert "P003" in exported
    said = say(capsys, "erase", "P003", "--reason", "withdrew", "--yes")
    assert "P003 is erased. labcrane cannot reach backups" in said
    assert f"P003 erased on {TODAY}: withdrew" in say(capsys, "participants")
    left = b"".join(path.read_bytes() for path in Path("data/exports").rglob("*.csv"))
    assert b"P003" not in left
    assert not list(study.rglob("*.h5"))


@pytest.mark.slow
def test_a_change_is_refused_in_words_and_amended(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    approve(capsys)
    say(capsys, "consent", "study.yaml", "P001")
    Path("study.yaml").write_text(
        GOVERNED.replace("movements: 1", "movements: 3"), encoding="utf-8"
    )
    said = say(capsys, "consent", "study.yaml", "P002", status=2)
    assert "protocol: tasks.aiming.movements was 1, is 3" in said
    refused = run_session("")
    assert refused.returncode == 2
    assert "protocol: tasks.aiming.movements was 1, is 3" in refused.stderr
    assert not Path("data/P001").exists()
    said = say(capsys, "amend", "study.yaml", "--why", "more", "--reference", "KB-1-A1")
    assert "amendment 1: protocol: tasks.aiming.movements was 1, is 3" in said
    assert "P002 has consented" in say(capsys, "consent", "study.yaml", "P002")
    assert (
        json.loads(Path("study.lock.json").read_text(encoding="utf-8"))["approval"]["board"]
        == "Ethics board"
    )


class Terminal(io.StringIO):
    """A terminal at which somebody types."""

    def isatty(self) -> bool:
        return True


@pytest.mark.slow
def test_more_participants_than_planned_are_a_deviation(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    planned = GOVERNED.replace("title:", "participants: {planned: 2}\ntitle:")
    Path("study.yaml").write_text(planned, encoding="utf-8")
    approve(capsys)
    for name in ("P001", "P002", "P001"):
        say(capsys, "consent", "study.yaml", name)
    told = "P003 would be participant 3 of 2 that are planned; exclude those who dropped out"
    assert told in say(capsys, "consent", "study.yaml", "P003", status=2)
    run = ["run", "study.yaml", "--participant", "P003", "--local", "--no-page"]
    assert told in say(capsys, *run, status=2)
    assert "P003" not in say(capsys, "participants")
    say(capsys, "exclude", "P001", "--reason", "dropped out")
    say(capsys, "consent", "study.yaml", "P003")
    assert "no deviations" in say(capsys, "deviations")
    assert "P004 would be participant 3 of 2" in say(
        capsys, "consent", "study.yaml", "P004", status=2
    )
    said = say(capsys, "consent", "study.yaml", "P004", "--beyond-planned")
    assert "P004 has consented" in said
    assert "P004 │ - │ - │ enrolled beyond the plan │ 3 of 2" in say(capsys, "deviations")


@pytest.mark.slow
def test_erase_asks_at_a_terminal_for_the_pseudonym(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    approve(capsys)
    for name in ("P001", "P003"):
        say(capsys, "consent", "study.yaml", name)
    words = ("erase", "P003", "--reason", "withdrew")
    monkeypatch.setattr("sys.stdin", Terminal("P001\n"))
    said = say(capsys, *words, status=2)
    assert "register.json" in said
    assert "'P001' was typed, not 'P003'; nothing was erased" in said
    assert "P003 erased" not in say(capsys, "participants")
    monkeypatch.setattr("sys.stdin", Terminal("P003\n"))
    assert "P003 is erased." in say(capsys, *words)
    assert f"P003 erased on {TODAY}" in say(capsys, "participants")


def test_erase_without_a_terminal_wants_yes(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    approve(capsys)
    say(capsys, "consent", "study.yaml", "P003")
    monkeypatch.setattr("sys.stdin", io.StringIO())
    words = ("erase", "P003", "--reason", "withdrew")
    said = say(capsys, *words, status=2)
    assert "erasing P003 cannot be undone, and there is no terminal at which to ask" in said
    assert "--yes erases it without asking" in said
    assert "P003 is erased." in say(capsys, *words, "--yes")


def test_a_date_that_is_none_is_told(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = say(
        capsys, "approve", "study.yaml", "--board", "B", "--reference", "R",
        "--valid-until", "next year", "--consent", "consent.txt", status=2,
    )  # fmt: skip
    assert "'next year' is not a date; write it as 2027-12-31" in said


def test_who_is_not_in_the_register_is_told(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    approve(capsys)
    say(capsys, "consent", "study.yaml", "P001")
    for command in (
        ["exclude", "P009", "--reason", "ill"],
        ["note", "P009", "left-handed"],
        ["waive", "P009", "--session", "2", "--reason", "ill"],
        ["erase", "P009", "--reason", "withdrew"],
        ["relabel", "P009", "P010"],
    ):
        said = say(capsys, *command, status=2)
        assert "participant P009 is not in the register; it has P001" in said


@pytest.mark.parametrize(
    ("here", "words"),
    [
        ("..", ["my_study"]),
        ("..", ["my_study/protocol.yaml"]),
        ("..", ["my_study/data"]),
        ("..", ["--data", "my_study"]),
        (".", []),
        (".", ["data"]),
        ("data", []),
    ],
)
def test_a_study_is_where_you_are_or_its_folder_its_protocol_or_its_data(
    here: str,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "my_study"
    (folder / "data").mkdir(parents=True)
    (folder / "protocol.yaml").write_text(GOVERNED, encoding="utf-8")
    put_stand_in(folder)
    with changed(Places(folder / "data")) as register:
        register.study = "rehearsal"
        register.participants["P001"] = Entry(slot=1, seed=1, enrolled="2026-01-02")
    monkeypatch.chdir(folder / here)
    assert "P001" in say(capsys, "participants", *words)
    assert "no deviations" in say(capsys, "deviations", *words)
    if "--data" not in words:
        assert "no journals below" in say(capsys, "recover", *words)
    if "--data" not in words:  # the commands of results take an argument only
        said = say(capsys, "report", *words, status=1)
        assert "there is no participant in" in said
        assert "data; give the folder" in said or here == "data"
        said = say(capsys, "check", *words)
        assert "study 'rehearsal' is fine" in said


def test_a_study_that_is_given_twice_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "data").mkdir()
    words = ("participants", str(tmp_path), "--data", str(tmp_path))
    assert "was given twice" in say(capsys, *words, status=2)


def test_a_study_stands_before_a_participant_too(
    study: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("study.yaml").rename("protocol.yaml")
    say(
        capsys, "approve", "--board", "B", "--reference", "R",
        "--valid-until", f"{TODAY.year + 1}-12-31", "--consent", "consent.txt",
    )  # fmt: skip
    assert "P001 has consented" in say(capsys, "consent", "P001")
    monkeypatch.chdir(study.parent)
    assert "P002 has consented" in say(capsys, "consent", study.name, "P002")
    say(capsys, "note", study.name, "P001", "left-handed")
    say(capsys, "exclude", f"{study.name}/data", "P001", "--reason", "dropped out")
    places = say(capsys, "where", f"{study.name}/protocol.yaml", "P001")
    assert "register" in places
    assert say(capsys, "where", f"{study.name}/protocol.yaml", "P001-SIMULATED") == places
    said = say(capsys, "participants", study.name)
    assert "P001: left-handed" in said
    assert "dropped out" in said
    say(capsys, "erase", study.name, "P001", "--reason", "withdrew", "--yes")
    assert "P001 erased" in say(capsys, "participants", study.name)
    said = say(capsys, "note", "P002", "two", "words", status=2)
    assert "'P002' stands where a study does, and there is none" in said
