"""The rules that keep plugins replaceable and start-up instant."""

import ast
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest
from needs import needs
from programs import ran

import labcrane

ROOT = Path(__file__).parents[2]
PLUGINS = sorted(path for path in (ROOT / "plugins").iterdir() if (path / "__init__.py").exists())
HEAVY = {
    "av", "mujoco", "pybullet", "pygame", "pyo", "panda3d", "pandas", "h5py", "nicegui", "pylsl",
    "matplotlib", "pint",
}  # fmt: skip
AIMING = str(ROOT / "protocols" / "aiming" / "protocol.yaml")


def imported_modules(source: str) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


PUBLIC = (
    "core", "machines", "recording", "analysis", "replay", "registry", "participants", "testing",
    "streams",
)  # fmt: skip
"""Packages whose names are public beside those of ``labcrane`` itself."""


def private_names(source: str) -> list[str]:
    """Return what a source imports from labcrane that is in no ``__all__``."""
    public = {"labcrane": set(labcrane.__all__)}
    public |= {f"labcrane.{part}": set(getattr(labcrane, part).__all__) for part in PUBLIC}
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "labcrane":
            known = public.get(node.module or "", set())
            found += [f"{node.module}.{a.name}" for a in node.names if a.name not in known]
        elif isinstance(node, ast.Import):
            ours = (alias.name for alias in node.names if alias.name.split(".")[0] == "labcrane")
            found += [name for name in ours if name not in public]
    return found


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda path: path.name)
def test_a_plugin_imports_public_names_only(plugin: Path) -> None:
    for module in plugin.rglob("*.py"):
        source = module.read_text(encoding="utf-8")
        assert not private_names(source), f"{module.relative_to(ROOT)} {private_names(source)}"
        others = {name for name in imported_modules(source) if name.startswith("labcrane_")}
        assert {name.split(".")[0] for name in others} <= {plugin.name}, module


TEMPLATES = ROOT / "labcrane" / "registry" / "templates"


@pytest.mark.parametrize(
    "path", sorted(TEMPLATES.rglob("*.py")), ids=lambda path: str(path.relative_to(TEMPLATES))
)
def test_a_new_plugin_imports_public_names_only(path: Path) -> None:
    assert not private_names(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "page",
    [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "own").glob("*.md")],
    ids=lambda path: path.stem,
)
def test_documents_import_public_names_only(page: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    assert not [n for block in blocks for n in private_names(block)]


def test_there_are_few_names_at_the_top_and_none_twice() -> None:
    top = set(labcrane.__all__) - set(PUBLIC)
    assert len(top) <= 30
    names = [name for part in PUBLIC for name in getattr(labcrane, part).__all__]
    assert {name for name in names if names.count(name) > 1} <= {"RATE_HZ"}
    assert top & set(names) <= {"open_recording"}
    for part in PUBLIC:
        package = getattr(labcrane, part)
        assert [name for name in package.__all__ if not hasattr(package, name)] == []


@pytest.mark.slow
def test_core_never_imports_a_plugin() -> None:
    for module in (ROOT / "labcrane").rglob("*.py"):
        names = imported_modules(module.read_text(encoding="utf-8"))
        assert not {name for name in names if name.startswith("labcrane_")}, module.name


def loaded_by(*arguments: str) -> set[str]:
    """Return the modules that a command loads."""
    program = (
        "import json, sys\n"
        "from labcrane.cli.app import main\n"
        "status = main(json.loads(sys.argv[1]))\n"
        "print(json.dumps([status, sorted(sys.modules)]))\n"
    )
    done = ran([sys.executable, "-c", program, json.dumps(arguments)], check=True)
    status, modules = json.loads(done.stdout.splitlines()[-1])
    assert status == 0, done.stdout + done.stderr
    return set(modules)


@needs("mujoco")
@pytest.mark.parametrize("arguments", [["--help"], ["plugins"], ["check", AIMING]])
def test_looking_loads_nothing_heavy(arguments: list[str]) -> None:
    modules = loaded_by(*arguments)
    assert not HEAVY & {name.split(".")[0] for name in modules}


@needs("mujoco")
def test_checking_a_protocol_imports_only_the_plugins_that_it_names() -> None:
    modules = loaded_by("check", AIMING)
    plugins = {name for name in modules if name.startswith("labcrane_") and "." not in name}
    named = (
        "aiming",
        "mujoco",
        "joystick",
        "operator",
        "schemes",
        "sonification",
        "sphere",
        "view",
    )
    assert plugins == {f"labcrane_{name}" for name in named}, "is labcrane installed as it is now?"


@needs("mujoco")
def test_checking_a_protocol_loads_nothing_that_works_with_what_it_says() -> None:
    modules = loaded_by("check", AIMING)
    working = {
        "numpy",
        "rich.console",
        "labcrane.types",
        "labcrane.core.items",
        "labcrane.core.primitives",
    }
    working |= {"labcrane.design.order", "labcrane.session.loop", "labcrane_aiming.movement"}
    assert not working & modules


def test_the_help_loads_no_model() -> None:
    modules = loaded_by("--help")
    assert not {"pydantic", "pluggy", "ruamel.yaml", "numpy"} & modules


def test_no_import_goes_round_in_a_circle() -> None:
    graph = grimp.build_graph("labcrane")
    order = TopologicalSorter(
        {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    )
    order.prepare()  # raises CycleError, which names the circle


def test_only_the_search_asks_liblsl_who_is_there() -> None:
    searching = [
        path.relative_to(ROOT).as_posix()
        for folder in ("labcrane", "plugins")
        for path in sorted((ROOT / folder).rglob("*.py"))
        if re.search(r"pylsl\.\w*[Rr]esolve|lsl_resolve", path.read_text(encoding="utf-8"))
    ]
    assert searching == ["labcrane/streams/search.py"]


ASKED_FOR_BY_OTHERS = {
    "get_code", "format_commands", "_fields_",
}  # fmt: skip
"""By Python's import, by click, and by ctypes."""


def defined(module: Path) -> Iterator[str]:
    """Yield what a module defines, but for what a decorator hands to somebody else."""
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = [ast.unparse(decorator) for decorator in node.decorator_list]
            if all("property" in name or "contextmanager" in name for name in given):
                yield node.name
        elif isinstance(node, ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (target.id for target in targets if isinstance(target, ast.Name))
            yield from (
                target.attr
                for target in targets
                if isinstance(target, ast.Attribute) and ast.unparse(target.value) == "self"
            )


@pytest.mark.slow
def test_nothing_is_defined_that_only_tests_use() -> None:
    places = (("labcrane", "*.py*"), ("plugins", "*.py"), ("docs", "*.md"), ("benchmarks", "*.py"))
    users = [path for folder, what in places for path in (ROOT / folder).rglob(what)]
    texts = [
        path.read_text(encoding="utf-8") for path in users if path.suffix in {".py", ".pyi", ".md"}
    ]
    used = Counter(word for text in texts for word in re.findall(r"\w+", text))
    idle = {
        f"{module.relative_to(ROOT)}: {name}"
        for folder in ("labcrane", "plugins")
        for module in (ROOT / folder).rglob("*.py")
        if "templates" not in module.parts
        for name in defined(module)
        if used[name] == 1 and not name.startswith(("__", "test_", "labcrane_"))
    }
    assert {entry.partition(": ")[2] for entry in idle} <= ASKED_FOR_BY_OTHERS, idle
