"""The commands, as a user types them."""

import subprocess
import sys
from pathlib import Path

import pytest
from needs import needs
from programs import ran
from rehearsal import SHORT, simulated_file
from rich.console import Console

import labcrane
from labcrane.cli.output import out, print_rows
from labcrane.registry import LAB
from labcrane.testing import main

ROOT = Path(__file__).parents[2]
AIMING = ROOT / "protocols" / "aiming" / "protocol.yaml"


def labcrane_command(
    *arguments: str, cwd: Path, said: str = ""
) -> subprocess.CompletedProcess[str]:
    return ran([sys.executable, "-m", "labcrane", *arguments], cwd=cwd, input=said)


@pytest.mark.slow
def test_the_demo_names_a_participant_file_and_a_picture_that_exist(tmp_path: Path) -> None:
    done = labcrane_command("demo", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    named = [line.split(":", 1)[1].strip() for line in done.stdout.splitlines()[-2:]]
    recording, picture = (tmp_path / name for name in named)
    assert len(labcrane.open_recording(recording).session(1).trials) == 8
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert done.stderr == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("without", "engine"),
    [
        pytest.param(["pybullet"], "mujoco_crane", marks=needs("mujoco")),
        (["pybullet", "mujoco"], "kinematic_crane"),
    ],
)
def test_the_demo_takes_the_best_engine_there_is_and_its_recording_is_replayed_on_it(
    tmp_path: Path, without: list[str], engine: str
) -> None:
    said = command_without(without, "demo", cwd=tmp_path)
    assert f"moved by:         {engine}\n" in said
    missing = f"without mujoco_crane: it needs mujoco, which is not installed: {LAB}"
    assert (missing in said) == ("mujoco" in without)
    recording = next((tmp_path / "labcrane-demo").rglob("*.h5"))
    assert engine in labcrane.open_recording(recording).session(1).context["protocol"]
    replayed = command_without(without, "replay", str(recording), "--session", "1", cwd=tmp_path)
    assert "every number the same bit for bit" in replayed


def command_without(modules: list[str], *arguments: str, cwd: Path) -> str:
    """Run a command where some modules are not installed; return what it says."""
    hidden = f"import sys; sys.modules.update(dict.fromkeys({modules!r}))"
    program = f"{hidden}; from labcrane.cli.app import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, *arguments]
    done = ran(command, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_the_demo_can_be_run_again_and_overwrites_nothing(tmp_path: Path) -> None:
    for _ in range(2):
        assert labcrane_command("demo", cwd=tmp_path).returncode == 0
    folders = sorted(path.name for path in (tmp_path / "labcrane-demo").iterdir())
    assert folders == ["P001-SIMULATED", "P002-SIMULATED"]


def test_a_mistake_ends_with_code_2_and_no_traceback(tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(SHORT.replace("rate_hz", "rat_hz"), encoding="utf-8")
    done = labcrane_command("check", "study.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "labcrane: study.yaml:4:1: 'rat_hz' is not a key of the file; did you mean 'rate_hz'?\n"
    )


def test_fast_without_simulate_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "study.yaml").write_text(SHORT, encoding="utf-8")
    path = str(tmp_path / "study.yaml")
    assert main(["run", path, "--participant", "P001", "--fast"]) == 2
    assert "--fast needs --simulate" in capsys.readouterr().err


@pytest.mark.slow
def test_lines_of_a_pipe_are_orders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A recorded operator needs no joystick, and is waited for like a person.
    simulated_file(tmp_path, SHORT)
    recorded = "{use: recorded, file: data/P001-SIMULATED/P001-SIMULATED.h5}"
    (tmp_path / "again.yaml").write_text(
        SHORT.replace("{use: dual_joystick}", recorded), encoding="utf-8"
    )
    done = labcrane_command(
        "run", "again.yaml", "--participant", "P002", "--local", "--pilot",
        cwd=tmp_path, said="note hello there\nnonsense\nend",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "'nonsense' is not an action; there is start, pause" in done.stdout
    session = labcrane.open_recording(tmp_path / "data" / "P002-PILOT" / "P002-PILOT.h5").session(1)
    names = session.events["name"].tolist()
    assert "order.note" in names
    assert session.events["data"][names.index("order.note")]["text"] == "hello there"
    assert session.events["data"][names.index("session.end")]["reason"] == "by order"


def test_groups_of_plugins_have_the_plugins_own_words(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import labcrane_dmd

    monkeypatch.setenv("COLUMNS", "120")
    assert main(["--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f" dmd {(labcrane_dmd.__doc__ or '').splitlines()[0]}" in said


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ('"""Lamps.\n\nAnd more."""', "Lamps."),
        ("raise SystemExit", "Commands of lamps.group."),
        ("# A licence\n\n'Lamps.'\n", "Lamps."),
        (None, "Not there any more: labcrane plugins says what is missing."),
    ],
)
def test_what_describes_a_group_is_read_without_running_it(
    source: str | None, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from labcrane.cli.plugin_groups import description

    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "lamps").mkdir()
    (tmp_path / "lamps" / "__init__.py").write_text("raise SystemExit", encoding="utf-8")
    if source is not None:
        (tmp_path / "lamps" / "group.py").write_text(source, encoding="utf-8")
    assert description("lamps.group") == said
    assert "lamps" not in sys.modules


@pytest.mark.parametrize("width", [40, 80])
def test_no_word_of_a_table_is_cut_however_narrow_the_terminal(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    console = Console(width=width, soft_wrap=True, highlight=False)
    monkeypatch.setattr(out, "console", console)
    titles = ("stream", "verdict", "rate Hz", "carries")
    print_rows(titles, [("amplifier [left]", "PASS", "500.0", "event-related potentials")])
    said = capsys.readouterr().out
    assert all(word in said for word in (*titles[1:], "amplifier [left]", "potentials"))
    assert any(line in said for line in "┃│") == (width == 80)  # Windows has one of them
