"""Discovery, and what users are told when it fails."""

import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest

import labcrane
from labcrane import Cue, Dynamics, PluginError, Task
from labcrane.registry.commands import plugin_commands
from labcrane.registry.hookspecs import ROLES
from labcrane.testing import discover

ROOT = Path(__file__).parents[2]


def point(name: str, module: str) -> EntryPoint:
    return EntryPoint(name, module, "labcrane")


def test_every_bundled_plugin_is_installed_and_imports() -> None:
    registry = discover()
    assert not registry.broken
    bundled = {path.parent.name for path in (ROOT / "plugins").glob("*/__init__.py")}
    assert bundled <= {entry.value for entry in entry_points(group="labcrane")}


def test_every_role_has_a_bundled_offer_and_a_contract_test() -> None:
    from labcrane import testing

    registry = discover()
    for role in ROLES:
        assert registry.offers[role], role
        contract = role.__name__.replace("Device", "") + "Contract"
        assert hasattr(testing, contract), contract


def test_every_bundled_offer_passes_its_contract() -> None:
    # A contract is passed by a test class that subclasses it and names the offer.
    tests = "\n".join(
        path.read_text(encoding="utf-8") for path in (ROOT / "tests" / "plugins").glob("test_*.py")
    )
    for role, offers in discover().offers.items():
        contract = role.__name__.replace("Device", "") + "Contract"
        assert contract in tests
        for name in offers:
            assert f'"{name}"' in tests, f"no contract test names the {role.__name__} {name!r}"


def test_a_near_miss_is_corrected() -> None:
    registry = discover([point("bullet", "labcrane_bullet")])
    with pytest.raises(
        PluginError,
        match=r"^dynamics 'bulet_crane' is not installed; did you mean 'bullet_crane'\? "
        r"\(labcrane plugins lists all\)$",
    ):
        registry.find(Dynamics, "bulet_crane")


def test_a_wild_guess_is_told_what_there_is() -> None:
    registry = discover([point("bullet", "labcrane_bullet")])
    with pytest.raises(PluginError, match="there is bullet_crane, kinematic_crane"):
        registry.find(Dynamics, "xyz")


def test_broken_plugin_is_named_only_when_it_could_have_helped() -> None:
    registry = discover(
        [point("sound", "labcrane_no_such_module"), point("aiming", "labcrane_aiming")]
    )
    assert registry.find(Task, "aiming").name == "aiming"
    with pytest.raises(
        PluginError, match="plugin 'sound' is broken: ModuleNotFoundError: No module named"
    ):
        registry.find(Dynamics, "gantry")


def test_a_plugin_that_raises_anything_on_import_is_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "raises_on_import.py").write_text("1 / 0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    registry = discover([point("zero", "raises_on_import")])
    where = tmp_path / "raises_on_import.py"
    assert registry.broken == {"zero": f"ZeroDivisionError: division by zero ({where}:1)"}


def test_two_plugins_may_not_offer_the_same_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = (ROOT / "plugins/labcrane_aiming/__init__.py").read_text(encoding="utf-8")
    (tmp_path / "copycat.py").write_text(source, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        PluginError, match="plugins 'a' and 'b' both offer the task 'aiming'; uninstall or rename"
    ):
        discover([point("a", "labcrane_aiming"), point("b", "copycat")])


def test_what_bundled_plugins_declare_is_what_they_offer() -> None:
    # What is not declared is found all the same, but by importing everything.
    installed = {entry.name: entry.value for entry in entry_points(group="labcrane")}
    registry = discover()
    offered = {
        (name, installed[plugin])
        for role in ROLES
        for name, plugin in registry.plugins[role].items()
        if (ROOT / "plugins" / installed[plugin]).exists()
    }
    declared = {(entry.name, entry.value) for entry in entry_points(group="labcrane.offers")}
    assert declared == offered


def test_a_name_leads_to_the_plugin_that_declares_it_and_to_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lamps(tmp_path, monkeypatch, declared=True)
    registry = discover()
    assert registry.find(Cue, "blink").name == "blink"
    assert registry.plugin(Cue, "blink") == "lamp_a"
    assert registry.roles("blink") == {Cue}
    assert "lamp_b" not in sys.modules
    with pytest.raises(PluginError, match=r"^cue 'blinc' is not .* did you mean 'blink'\?"):
        registry.find(Cue, "blinc")
    assert "lamp_b" in sys.modules  # whoever is told what there is, is told of all


def test_a_plugin_that_declares_nothing_is_asked_always(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lamps(tmp_path, monkeypatch, declared=False)
    assert discover().find(Cue, "glow").name == "glow"


def test_a_plugin_that_offers_more_than_it_declares_is_found_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lamps(tmp_path, monkeypatch, declared=True)
    assert discover().find(Cue, "undeclared_a").name == "undeclared_a"


LAMP = """\
import labcrane

labcrane_api = 1

@labcrane.hookimpl
def labcrane_cues():
    return [labcrane.offer(name, labcrane.Settings, None) for name in NAMES]
"""


def lamps(folder: Path, monkeypatch: pytest.MonkeyPatch, *, declared: bool) -> None:
    """Install two plugins, whose cues are called blink and glow."""
    monkeypatch.syspath_prepend(folder)
    for plugin, name in (("a", "blink"), ("b", "glow")):
        monkeypatch.delitem(sys.modules, f"lamp_{plugin}", raising=False)
        names = [name, f"undeclared_{plugin}"]
        (folder / f"lamp_{plugin}.py").write_text(
            LAMP.replace("NAMES", repr(names)), encoding="utf-8"
        )
        info = folder / f"lamp_{plugin}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: lamp_{plugin}\nVersion: 1.0\n", encoding="utf-8"
        )
        lines = ["[labcrane]", f"lamp_{plugin} = lamp_{plugin}"]
        lines += ["[labcrane.offers]", f"{name} = lamp_{plugin}"] if declared else []
        (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


BROKEN = {
    "import labcrane\n@labcrane.hookimpl\ndef labcrane_task(): return []\n": (
        "unknown hook 'labcrane_task'; did you mean 'labcrane_tasks'?"
    ),
    "labcrane_api = 2\n": (
        "it is built for plugin interface 2, and this labcrane has 1; install a newer labcrane, or "
        "see docs/compatibility.md"
    ),
    "labcrane_api = 0\n": (
        "it is built for plugin interface 0, and this labcrane has 1; install a newer version of "
        "the plugin, or see docs/compatibility.md"
    ),
    "from labcrane import Crane\n": (
        f"ImportError: cannot import name 'Crane' from 'labcrane' ({labcrane.__file__}) (FILE:1)"
    ),
    "import sys\nsys.exit('no licence')\n": "SystemExit: no licence (FILE:2)",
    "def labcrane_cues(:\n": "SyntaxError: invalid syntax (plugin_FILE, line 1)",
    "import labcrane\n@labcrane.hookimpl\ndef labcrane_cues():\n    return 1 / 0\n": (
        "ZeroDivisionError: division by zero (FILE:4)"
    ),
    "import labcrane\n@labcrane.hookimpl\ndef labcrane_cues():\n    return 'arrow'\n": (
        "labcrane_cues must return a list of labcrane.offer(...), not 'arrow'"
    ),
}


@pytest.mark.parametrize(("number", "source"), [*enumerate(BROKEN)])
def test_a_plugin_that_does_not_fit_is_named_and_the_others_go_on(
    number: int, source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = f"plugin_that_does_not_fit_{number}"
    path = tmp_path / f"{module}.py"
    path.write_text(source, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    registry = discover([point("misfit", module), point("aiming", "labcrane_aiming")])
    why = BROKEN[source].replace("plugin_FILE", path.name).replace("FILE", str(path))
    assert registry.broken == {"misfit": why}
    assert registry.find(Task, "aiming").name == "aiming"


def test_the_line_of_a_plugin_is_told_though_a_library_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "in_two_files"
    package.mkdir()
    (package / "__init__.py").write_text("import in_two_files.lamp\n", encoding="utf-8")
    (package / "lamp.py").write_text("import json\n\njson.loads('{')\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    (why,) = discover([point("lamp", "in_two_files")]).broken.values()
    assert why.startswith("JSONDecodeError: ")
    assert why.endswith(f"({package / 'lamp.py'}:3)")


@pytest.mark.parametrize(
    ("offers", "complaint"),
    [
        ("raise ValueError('no lift today')", r"ValueError: no lift today \(.*lifting.py:\d+\)"),
        (
            "return 'lift'",
            r"labcrane_commands must return a list of labcrane.registry.CommandOffer\(...\)",
        ),
    ],
)
def test_commands_that_cannot_be_offered_are_told_of_with_their_plugin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, offers: str, complaint: str
) -> None:
    (tmp_path / "lifting.py").write_text(
        f"import labcrane\n@labcrane.hookimpl\ndef labcrane_commands():\n    {offers}\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "lifting", raising=False)
    with pytest.raises(PluginError, match=f"^plugin 'lift' is broken: {complaint}"):
        plugin_commands([point("lift", "lifting")])
