"""Checks of the benchmarks: what is slower, larger or worse than promised makes them red."""

import importlib
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest
from needs import needs

from labcrane_bullet.bullet_crane import BulletCrane

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
        module.rows = lambda name=name, ratio=ratio: [
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


def test_the_table_is_what_was_measured_with_every_limit(benchmarks: types.ModuleType) -> None:
    benchmarks.main([])
    *_, fine, slow = benchmarks.RESULTS.read_text(encoding="utf-8").splitlines()
    assert fine.startswith("| fine | a step, us | 3 | a bare one | 3 | 1.00 | 2.00 | 20")
    assert slow.startswith("| slow | a step, us | 6.3 | a bare one | 3 | 2.10 | 2.00 | 20")


def test_a_ratio_that_is_no_number_is_missed() -> None:
    table = importlib.import_module("benchmarks.table")
    nothing = table.Row("a", "b", float("nan"), 1.0, "c", 2.0)
    assert table.missed([nothing])


@needs("pybullet")
@pytest.mark.parametrize("slower_s", [0.0, 0.002])
def test_a_component_that_takes_two_milliseconds_more_a_tick_is_missed(
    slower_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tick = importlib.import_module("benchmarks.tick")
    monkeypatch.setattr(
        tick, "LIMITS", {"whole": (20.0, float("inf"))}
    )  # on however busy a computer
    step = BulletCrane.step

    def slow(self: BulletCrane, *arguments: object) -> object:
        until = time.perf_counter() + slower_s
        while time.perf_counter() < until:
            pass
        return step(self, *arguments)

    monkeypatch.setattr(BulletCrane, "step", slow)
    monkeypatch.setattr(tick, "WARM_UP", 10)
    rows = tick.costs(tick.cost(tmp_path, rounds=1, count=200, kinds=(("whole", False),)))
    missed = importlib.import_module("benchmarks.table").missed(rows)
    assert bool(missed) == bool(slower_s), rows


def test_an_engine_that_costs_more_than_it_may_is_missed() -> None:
    tick = importlib.import_module("benchmarks.tick")
    missed = importlib.import_module("benchmarks.table").missed
    assert not missed([tick.engine_row({"bullet_crane": 1e-5, "mujoco_crane": 6e-6})])
    assert missed([tick.engine_row({"bullet_crane": 1e-5, "mujoco_crane": 8e-6})])


def test_memory_is_that_of_the_command_itself_and_not_of_who_started_it() -> None:
    own_process = importlib.import_module("benchmarks.own_process")
    ballast = bytearray(600_000_000)
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
