"""What a change touches: `.ci/run changed` runs these tests and no others."""

import random
from pathlib import Path

import pytest
from gate_program import gate_program

ROOT = Path(__file__).parents[2]
TESTS = {
    str(path.relative_to(ROOT)): path.read_text("utf-8") for path in ROOT.glob("tests/**/*.py")
}
PROGRAM = gate_program("touched")


@pytest.mark.parametrize(
    ("changed", "among"),
    [
        ("labcrane/session/loop.py", "tests/session"),
        ("labcrane/web/page.py", "tests/pages"),
        ("labcrane/monitoring/process.py", "tests/streams/test_monitoring.py"),
        ("labcrane/errors.py", "tests"),
        ("plugins/labcrane_view/camera.py", "tests/plugins/test_view_whole.py"),
        ("tests/helpers/gate.py", "tests/helpers/test_gate.py"),
        ("tests/helpers/once.py", "tests/governance"),
        ("tests/faults/witness.py", "tests/faults"),
        ("tests/recording/former/none/P001.h5", "tests/recording"),
        ("tests/conftest.py", "tests"),
        ("tests/session/test_stops.py", "tests/session/test_stops.py"),
        ("benchmarks/tick.py", "tests/test_benchmarks.py"),
        ("protocols/aiming/protocol.yaml", "tests/docs"),
        ("pyproject.toml", "tests"),
        ("docs/lab.md", "tests/docs"),
    ],
)
def test_tests_of_what_changed_are_named(changed: str, among: str) -> None:
    assert among in PROGRAM.touched(changed, TESTS)


def test_any_module_and_helper_touches_a_test() -> None:
    folders = ("labcrane", "plugins", "tests", "benchmarks")
    every = sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))
    every = random.Random(20261128).sample(every, 20)
    nothing = [path for path in every if not PROGRAM.touched(str(path.relative_to(ROOT)), TESTS)]
    assert nothing == []
