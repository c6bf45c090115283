"""Checks of the benchmarks: what is slower, larger or worse than promised makes them red."""

import importlib
import subprocess
import sys
import time
import types
from datetime import UTC, datetime
from pathlib import Path

import pytest
from needs import needs
from programs import ran

# At the end: processes that a test starts import labcrane from where this one did.
sys.path.append(str(Path(__file__).parents[1]))

SUBJECTS = {"fine": 1.0, "slow": 2.1}


@pytest.fixture
def benchmarks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> types.ModuleType:
    """The program, with two subjects of its own whose limits are 2, and another table."""
    main = importlib.import_module("benchmarks.__main__")
    row = importlib.import_module("benchmarks.table").Row
    for name, ratio in SUBJECTS.items():
        module = types.ModuleType(f"benchmarks.{name}")
        module.rows = lambda name=name, ratio=ratio, **_: [
            row(name, "a step, us", 3.0 * ratio, 3.0, "a bare one", 2.0)
        ]
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(main, "SUBJECTS", tuple(SUBJECTS))
    monkeypatch.setattr(main, "RESULTS", tmp_path / "RESULTS.md")
    return main


def test_a_ratio_above_its_limit_is_named_and_fails_the_check(
    benchmarks: types.ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    assert benchmarks.main(["--check"]) == 1
    said = capsys.readouterr().out
    assert "MISSED slow: a step, us is 6.3, 2.1 times a bare one (3); at most 2 times" in said
    assert "MISSED fine" not in said
    assert benchmarks.main(["--check", "--only", "fine"]) == 0
    assert benchmarks.main(["--only", "slow"]) == 0, "it only tells unless it is asked to check"


def test_a_benchmark_whose_programs_are_not_installed_is_not_tried_by_name(
    benchmarks: types.ModuleType,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(benchmarks, "NEEDS", {"slow": ("no-such-server",)})
    assert benchmarks.main(["--check"]) == 0
    said = capsys.readouterr().out
    assert "slow was not tried: there is no no-such-server\n" in said
    assert "all 1 are kept" in said


def test_what_another_computer_missed_is_named_and_fails_the_check(
    benchmarks: types.ModuleType,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    results = importlib.import_module("benchmarks.results")
    with monkeypatch.context() as there:
        there.setattr(results, "machine", lambda: "a slower one")
        benchmarks.main([])
    rows = [results.Row("slow", "a step, us", 3.0, 3.0, "a bare one", 2.0)]
    monkeypatch.setattr(sys.modules["benchmarks.slow"], "rows", lambda **_: rows)
    capsys.readouterr()
    assert benchmarks.main(["--check", "--only", "fine"]) == 0
    assert benchmarks.main(["--check"]) == 1
    (kept,) = [line for line in capsys.readouterr().out.splitlines() if "MISSED" in line]
    assert kept.startswith("MISSED slow: a step, us: 2.10 (6.3 / 3, 20")
    assert kept.endswith(" of 2.00 on a slower one; measure it again there")


def test_the_table_has_a_column_for_each_computer(
    benchmarks: types.ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    results = importlib.import_module("benchmarks.results")
    for computer, subjects in {"old": [], "new": ["--only", "fine"]}.items():
        monkeypatch.setattr(results, "machine", lambda computer=computer: computer)
        benchmarks.main(subjects)
    *_, head, _, fine, slow = benchmarks.RESULTS.read_text(encoding="utf-8").splitlines()
    assert head == "| benchmark | figure | reference | at most | old | new |"
    day = datetime.now(UTC).date()
    cell = f"1.00 (3 / 3, {day})"
    assert fine == f"| fine | a step, us | a bare one | 2.00 | {cell} | {cell} |"
    assert slow == f"| slow | a step, us | a bare one | 2.00 | 2.10 (6.3 / 3, {day}) |  |"
    monkeypatch.setattr(sys.modules["benchmarks.fine"], "rows", lambda **_: [])
    benchmarks.main(["--only", "fine"])
    assert "| fine |" not in benchmarks.RESULTS.read_text(encoding="utf-8"), "no such figure"


@pytest.mark.parametrize("error", [FileNotFoundError("no jackd"), SystemExit(3)])
def test_a_benchmark_that_cannot_be_run_is_named_and_the_others_go_on(
    benchmarks: types.ModuleType,
    error: BaseException,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def rows(**_: bool) -> list[object]:
        raise error

    benchmarks.main([])
    monkeypatch.setattr(sys.modules["benchmarks.fine"], "rows", rows)
    capsys.readouterr()
    assert benchmarks.main([]) == 1, "whether it is asked to check or not"
    said = capsys.readouterr().out
    assert f"MISSED fine could not be run: {type(error).__name__}: {error}\n" in said
    assert "MISSED slow: a step, us is 6.3" in said
    *_, fine, slow = benchmarks.RESULTS.read_text(encoding="utf-8").splitlines()
    assert fine.startswith("| fine |"), "what was measured before stays, with its date"
    assert slow.startswith("| slow |")


def test_a_benchmark_without_a_figure_is_missed(
    benchmarks: types.ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys.modules["benchmarks.fine"], "rows", lambda **_: [])
    assert benchmarks.main(["--only", "fine"]) == 1
    assert "MISSED fine gave no figure\n" in capsys.readouterr().out


def test_the_table_that_is_kept_is_the_one_that_is_written_now() -> None:
    main = importlib.import_module("benchmarks.__main__")
    text = main.RESULTS.read_text(encoding="utf-8")
    assert main.Results.read(main.RESULTS).text(main.SUBJECTS) == text


IN_SECONDS = (
    "scenario", "oversight", "recording", "length", "signals", "sound", "film", "start_up",
)  # fmt: skip


def marked(subject: str) -> object:
    mark = pytest.mark.slow if subject in IN_SECONDS else pytest.mark.long
    return pytest.param(subject, marks=mark)


@needs("chromium", "jackd", "pybullet")
@pytest.mark.parametrize(
    "subject", [marked(each) for each in importlib.import_module("benchmarks.__main__").SUBJECTS]
)
def test_every_benchmark_can_be_run(subject: str) -> None:
    done = ran(
        [sys.executable, "-m", "benchmarks", "--brief", "--only", subject],
        cwd=Path(__file__).parents[1],
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "; ratio " in done.stdout
    assert done.stdout.endswith("all could be run\n")


def test_a_ratio_that_is_no_number_is_missed() -> None:
    table = importlib.import_module("benchmarks.table")
    nothing = table.Row("a", "b", float("nan"), 1.0, "c", 2.0)
    assert table.missed([nothing])


@pytest.mark.slow
@needs("pybullet")
def test_the_parts_of_a_tick_sum_up_and_a_slow_one_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tick = importlib.import_module("benchmarks.tick")
    plain = tick.Waves.read

    def read(waves: object, *values: object) -> object:
        time.sleep(0.002)
        return plain(waves, *values)

    monkeypatch.setattr(tick.Waves, "read", read)
    found = {line[:16].strip(): float(line[16:-3]) for line in tick.profile(200).splitlines()}
    del found["bare PyBullet"]
    whole = found.pop("whole tick")
    assert sum(found.values()) == pytest.approx(whole, abs=1.0)
    assert found["read"] > 2000.0
    assert found["read"] == max(found.values())


@needs("pybullet")
@pytest.mark.parametrize("slower_s", [0.0, 0.002])
def test_a_component_that_takes_two_milliseconds_more_a_tick_is_missed(
    slower_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tick = importlib.import_module("benchmarks.tick")
    monkeypatch.setattr(
        tick, "LIMITS", {"whole": ("bare", 20.0, 1e9)}
    )  # on however busy a computer
    crane = importlib.import_module("labcrane_bullet.bullet_crane").BulletCrane
    step = crane.step

    def slow(self: object, *arguments: object) -> object:
        until = time.perf_counter() + slower_s
        while time.perf_counter() < until:
            pass
        return step(self, *arguments)

    monkeypatch.setattr(crane, "step", slow)
    monkeypatch.setattr(tick, "WARM_UP", 10)
    rows = tick.costs(tick.cost(tmp_path, rounds=1, count=200, kinds=(("whole", False),)))
    missed = importlib.import_module("benchmarks.table").missed(rows)
    assert bool(missed) == bool(slower_s), rows


def test_memory_is_that_of_the_command_itself_and_not_of_who_started_it() -> None:
    own_process = importlib.import_module("benchmarks.own_process")
    ballast = bytearray(400_000_000)
    ballast[::4096] = b"x" * len(ballast[::4096])
    assert own_process.used("--version").megabytes < 300
    del ballast


PROGRAM = """
from types import SimpleNamespace

def rows(): return [SimpleNamespace(what={what!r}, ours={ours}), SimpleNamespace(what="b", ours=2)]
"""


def test_what_has_become_slower_since_a_commit_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    since = importlib.import_module("benchmarks.since")
    # Of two versions of one second and one size, the first would be kept.
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(since, "ROOT", tmp_path)
    program = tmp_path / "benchmarks" / "step.py"
    program.parent.mkdir()
    (program.parent / "__init__.py").touch()
    program.write_text(PROGRAM.format(what="a", ours=10.0))
    author = ["-c", "user.name=a", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "."], [*author, "commit", "-qm", "before"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    program.write_text(PROGRAM.format(what="a", ours=10.4))
    asked = ["HEAD", "--only", "step", "--rounds", "3", "--check"]
    assert since.main(asked) == 1
    said = capsys.readouterr().out
    assert "step: a: 1.040 [1.040..1.040] in 3 rounds" in said
    assert "step: b: 1.000" in said
    assert said.endswith("MISSED step: a\n")
    program.write_text(PROGRAM.format(what="a", ours=10.2))
    assert since.main(asked) == 0
    program.write_text(PROGRAM.format(what="c", ours=99.0))
    assert since.main(asked) == 0
    said = capsys.readouterr().out
    assert "step: a: only before, not compared" in said
    assert "step: c: only now, not compared" in said


def test_a_scale_goes_on_along_its_line_and_says_how_far_it_bends() -> None:
    scale = importlib.import_module("benchmarks.scale")
    laws = {"s": lambda n: 2.0 + 0.5 * n, "MB": lambda n: 3.0 + n**2, "files": lambda _: 7.0}
    grown = scale.Scale(
        "a report", "people", (10, 20, 30), (100,), lambda n: {u: f(n) for u, f in laws.items()}
    )
    _, _, *rows = (line.strip("|").split(" | ") for line in scale.lines([grown]))
    assert rows[0][2:] == ["7, 12, 17 s", "52 s for 100", "1.00 "]
    assert rows[1][4] == f"{500 / 300:.2f} "
    assert rows[2][4] == "none grows "


@pytest.mark.slow
def test_a_stream_of_more_channels_takes_longer() -> None:
    streamed = importlib.import_module("benchmarks.scale").streamed
    assert 0.0 < streamed(8)["s"] < streamed(256)["s"] < 1.0
