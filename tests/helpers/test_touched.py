"""What a change touches: `.ci/run changed` runs these tests and no others."""

import random
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
TESTS = {
    str(path.relative_to(ROOT)): path.read_text("utf-8") for path in ROOT.glob("tests/**/*.py")
}


@pytest.fixture(scope="module")
def program() -> ModuleType:
    loader = SourceFileLoader("touched", str(ROOT / ".ci" / "touched"))
    spec = spec_from_loader("touched", loader)
    assert spec
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("changed", "among"),
    [
        ("labcrane/session/loop.py", "tests/session"),
        ("labcrane/web/page.py", "tests/pages"),
        ("labcrane/monitoring/process.py", "tests/streams/test_monitoring.py"),
        ("labcrane/errors.py", "tests"),
        ("plugins/labcrane_view/camera.py", "tests/plugins/test_view_whole.py"),
        ("tests/helpers/second_try.py", "tests/helpers/test_second_try.py"),
        ("tests/helpers/once.py", "tests/governance"),
        ("tests/faults/witness.py", "tests/faults"),
        ("tests/conftest.py", "tests"),
        ("tests/session/test_stops.py", "tests/session/test_stops.py"),
        ("benchmarks/tick.py", "tests/test_benchmarks.py"),
        ("protocols/aiming/protocol.yaml", "tests/docs"),
        ("pyproject.toml", "tests"),
        ("docs/lab.md", "tests/docs"),
    ],
)
def test_tests_of_what_changed_are_named(program: ModuleType, changed: str, among: str) -> None:
    assert among in program.touched(changed, TESTS)


def test_any_module_and_helper_touches_a_test(program: ModuleType) -> None:
    folders = ("labcrane", "plugins", "tests", "benchmarks")
    every = sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))
    every = random.Random(20261128).sample(every, 20)
    nothing = [path for path in every if not program.touched(str(path.relative_to(ROOT)), TESTS)]
    assert nothing == []
