"""Checks of the benchmarks: what is slower, larger or worse than promised makes them red."""

import ast
import dataclasses
import importlib
import itertools
import subprocess
import sys
import time
import types
from pathlib import Path

import numpy as np
import pytest
from needs import needs

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


def test_what_was_missed_before_and_is_not_measured_now_is_named(
    benchmarks: types.ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    benchmarks.main([])
    with benchmarks.RESULTS.open("a", encoding="utf-8") as table:
        table.write("| slow | a leap, us | 1 | a bare one | 1 | 1.00 |  | long ago |\n")
    capsys.readouterr()
    assert benchmarks.main(["--check", "--only", "fine"]) == 0
    *_, kept, limitless = capsys.readouterr().out.splitlines()
    assert kept.startswith("MISSED BEFORE slow: a step, us: 2.10 of 2.00, kept of 20")
    assert limitless == (
        "MISSED BEFORE slow: a leap, us: 1.00, without a limit, kept of long ago; "
        "measure slow again"
    )
    benchmarks.main([])
    assert "MISSED BEFORE" not in capsys.readouterr().out


def test_the_table_is_what_was_measured_with_every_limit(benchmarks: types.ModuleType) -> None:
    benchmarks.main([])
    *_, fine, slow = benchmarks.RESULTS.read_text(encoding="utf-8").splitlines()
    assert fine.startswith("| fine | a step, us | 3 | a bare one | 3 | 1.00 | 2.00 | 20")
    assert slow.startswith("| slow | a step, us | 6.3 | a bare one | 3 | 2.10 | 2.00 | 20")


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


def test_the_table_that_is_kept_has_the_head_and_the_columns_that_are_written_now() -> None:
    main = importlib.import_module("benchmarks.__main__")
    text = main.RESULTS.read_text(encoding="utf-8")
    assert text.startswith(main.head())
    rows = text.removeprefix(main.head()).splitlines()
    assert {row.split("|")[1].strip() for row in rows} <= set(main.SUBJECTS)
    assert {row.count("|") for row in rows} == {main.HEAD.count("|")}


@pytest.mark.parametrize("limit", [float("inf"), float("nan"), 0.0])
def test_a_row_without_a_limit_that_can_be_missed_is_none(limit: float) -> None:
    row = importlib.import_module("benchmarks.table").Row
    with pytest.raises(ValueError, match=f"a: b: {limit} cannot limit a ratio"):
        row("a", "b", 1.0, 1.0, "c", limit)


def test_every_benchmark_makes_rows_and_says_their_limits_itself() -> None:
    main = importlib.import_module("benchmarks.__main__")
    row = importlib.import_module("benchmarks.table").Row
    (limit,) = [field for field in dataclasses.fields(row) if field.name == "limit"]
    assert limit.default is limit.default_factory is dataclasses.MISSING
    for subject in main.SUBJECTS:
        source = Path(main.__file__).with_name(f"{subject}.py").read_text(encoding="utf-8")
        calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
        assert any(ast.unparse(call.func) == "Row" for call in calls), subject


@pytest.mark.parametrize("subject", importlib.import_module("benchmarks.__main__").SUBJECTS)
def test_every_benchmark_can_be_imported(subject: str) -> None:
    assert callable(importlib.import_module(f"benchmarks.{subject}").rows)


IN_SECONDS = ("scenario", "oversight", "recording", "length", "signals", "sound", "start_up")


def marked(subject: str) -> object:
    mark = pytest.mark.slow if subject in IN_SECONDS else pytest.mark.long
    return pytest.param(subject, marks=mark)


@needs("chromium", "jackd", "pybullet")
@pytest.mark.parametrize(
    "subject", [marked(each) for each in importlib.import_module("benchmarks.__main__").SUBJECTS]
)
def test_every_benchmark_can_be_run(subject: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", "--brief", "--only", subject],
        cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"| {subject} | " in done.stdout
    assert done.stdout.endswith("all could be run\n")


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


def test_an_engine_that_costs_more_than_it_may_is_missed() -> None:
    tick = importlib.import_module("benchmarks.tick")
    missed = importlib.import_module("benchmarks.table").missed
    assert not missed([tick.engine_row({"bullet_crane": 1e-5, "mujoco_crane": 6e-6})])
    assert missed([tick.engine_row({"bullet_crane": 1e-5, "mujoco_crane": 8e-6})])


SESSION_HZ = 240


def held_where(late: dict[str, set[int]]) -> dict[str, float]:
    """Return the rates held by loops that are late at some steps and at no other."""
    tick = importlib.import_module("benchmarks.tick")
    steps = {rate: number for number, rate in enumerate(tick.RATES_HZ)}
    return tick.rates(Path(), lambda kind, rate, _: float(steps[rate] in late[kind]))


def test_a_rate_above_one_that_is_not_held_does_not_count() -> None:
    tick = importlib.import_module("benchmarks.tick")
    found = held_where({"empty": {9}, "whole": {3, 5}})
    assert found == {"empty": tick.RATES_HZ[8], "whole": tick.RATES_HZ[2]}


@pytest.mark.parametrize("late", [{"whole"}, {"empty"}, {"whole", "empty"}])
def test_a_loop_that_holds_not_even_the_lowest_rate_is_missed(late: set[str]) -> None:
    tick = importlib.import_module("benchmarks.tick")
    missed = importlib.import_module("benchmarks.table").missed
    held = held_where({kind: {0} if kind in late else set() for kind in ("empty", "whole")})
    assert missed([tick.rate_row(held)])
    assert not missed([tick.rate_row(held_where({"empty": set(), "whole": set()}))])


def test_rates_rise_in_steps_of_a_fifth_from_that_of_a_session() -> None:
    tick = importlib.import_module("benchmarks.tick")
    steps = [upper / lower for lower, upper in itertools.pairwise(tick.RATES_HZ)]
    assert tick.RATES_HZ[0] == SESSION_HZ
    assert max(steps) < 1.21
    assert tick.SLOWEST < 2.5, "no loop may lose half its rate and half of the rest unseen"


def promised_of(**changed: object) -> list[str]:
    """Return what is missed of ten draws that keep all promises, but for what is changed."""
    score = importlib.import_module("streams.unkind_score")
    fault = next(iter(score.Fault))
    kept = score.Score(
        row="unkind", p95=0.1, most=0.2, cover=1.0, width=0.1, passed=True, usual=0.5,
        untouched=0.5, named=frozenset({fault}), present=frozenset({fault}), clean=True, limit=0.2,
        samples=1000, apart=0.1, usual_apart=0.5, apart_limit=0.2, chance=False,
    )  # fmt: skip
    draws = [kept] * 9 + [dataclasses.replace(kept, **changed)]
    sync = importlib.import_module("benchmarks.sync")
    return importlib.import_module("benchmarks.table").missed(sync.promises(draws))


@pytest.mark.parametrize(
    ("changed", "missed"),
    [
        ({}, []),
        (
            {"p95": 0.3, "usual": 0.6},
            ["draws of misbehaving devices that miss a target, and one is 2"],
        ),
        (
            {"p95": 9.9, "usual": 0.1, "untouched": 10.0, "clean": False},
            ["misbehaving devices worse than by pyxdf, and one is 2"],
        ),
        ({"cover": 0.95, "samples": 9000}, ["samples beyond what is stated, % is 2.5"]),
        ({"named": frozenset()}, ["worst fault: wrong or left out, % is 10"]),
        ({"present": frozenset()}, ["worst fault: wrong or left out, % is 10"]),
    ],
)
def test_each_promise_of_unkind_devices_that_is_broken_is_missed(
    changed: dict[str, object], missed: list[str]
) -> None:
    found = promised_of(**changed)
    assert len(found) == len(missed), found
    for line, words in zip(found, missed, strict=True):
        assert line.startswith(f"sync: {words},")


def test_each_unkind_device_is_a_row_with_a_limit_that_its_error_can_miss() -> None:
    score = importlib.import_module("streams.unkind_score")
    sync = importlib.import_module("benchmarks.sync")
    missed = importlib.import_module("benchmarks.table").missed
    good = score.Score(
        row="good", p95=0.1, most=0.2, cover=1.0, width=0.1, passed=True, usual=0.5,
        untouched=0.5, named=frozenset(), present=frozenset(), clean=True, limit=0.2,
        samples=1000, apart=0.1, usual_apart=0.5, apart_limit=0.2, chance=False, stated=3.0,
    )  # fmt: skip
    beyond = dataclasses.replace(good, row="beyond", p95=0.31)
    late = dataclasses.replace(good, row="late", p95=2.9, clean=False)
    untold = dataclasses.replace(late, row="untold", p95=3.1)
    rows = sync.of_devices([good, good, good, beyond, late, untold])
    assert [row.what.partition(",")[0] for row in rows] == ["good", "beyond", "late", "untold"]
    assert [line.partition(",")[0] for line in missed(rows)] == ["sync: beyond", "sync: untold"]


@pytest.mark.parametrize(("wrong", "clocks"), [(0, 3), (1, 3), (0, 2), (0, 4)])
def test_a_wrong_stamp_or_a_clock_that_is_not_found_after_restarts_is_missed(
    wrong: int, clocks: int
) -> None:
    sync = importlib.import_module("benchmarks.sync")
    missed = importlib.import_module("benchmarks.table").missed
    assert len(missed(sync.restarted(wrong, clocks, 2))) == (wrong > 0) + (clocks != 3)


ENDING = "import sys; print({said!r}); print('no gcc', file=sys.stderr); sys.exit({code})"


@pytest.mark.parametrize(
    ("ours", "code", "fails"), [(1.0, 0, False), (3.0, 1, False), (1.0, 1, True), (None, 1, True)]
)
def test_the_exit_status_of_the_benchmark_of_sync_counts(
    *, ours: float | None, code: int, fails: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    sync = importlib.import_module("benchmarks.sync")
    table = importlib.import_module("benchmarks.table")
    rows = [] if ours is None else [table.Row("sync", "error, ms", ours, 2.0, "limit", 1.0)]
    said = table.dumped(rows) if rows else "a table that ends"
    run = subprocess.run
    program = [sys.executable, "-c", ENDING.format(said=said, code=code)]
    monkeypatch.setattr(sync.subprocess, "run", lambda _, **how: run(program, **how))
    if fails:
        with pytest.raises(RuntimeError, match="no gcc"):
            sync.rows()
    else:
        assert sync.rows() == rows
        assert bool(table.missed(rows)) == bool(code)


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


def test_a_scenario_whose_ticks_are_slower_than_promised_or_too_long_is_missed() -> None:
    scenario = importlib.import_module("benchmarks.scenario")
    tick = 1.0 / scenario.RATE_HZ

    missed = importlib.import_module("benchmarks.table").missed

    def told(casualty: float, reach_over: float = 6e-4) -> list[str]:
        taken = {"kinematic": 4e-5, "casualty": casualty, "carry": 6e-4, "reach_over": reach_over}
        return missed(scenario.tick_rows({name: [np.full(9, one)] for name, one in taken.items()}))

    assert not told(0.98 * scenario.LIMITS["casualty"] * 4e-5)
    (slow,) = told(1.02 * scenario.LIMITS["casualty"] * 4e-5)
    assert "casualty, median" in slow
    assert len(told(0.81 * tick)) == 2
    (slow,) = told(4e-5, 1.04 * scenario.LIMITS["reach_over"] * 4e-5)
    assert "reach_over, median" in slow
