"""Discovery, and what users are told when it fails."""

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest

from labcrane import Dynamics, PluginError, Task
from labcrane.registry import ROLES, discover

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
    tests = "\n".join(path.read_text() for path in (ROOT / "tests" / "plugins").glob("test_*.py"))
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
    (tmp_path / "raises_on_import.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    registry = discover([point("zero", "raises_on_import")])
    assert registry.broken == {"zero": "ZeroDivisionError: division by zero"}


def test_two_plugins_may_not_offer_the_same_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = (ROOT / "plugins/labcrane_aiming/__init__.py").read_text()
    (tmp_path / "copycat.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        PluginError, match="plugins 'a' and 'b' both offer the task 'aiming'; uninstall or rename"
    ):
        discover([point("a", "labcrane_aiming"), point("b", "copycat")])


def test_misspelt_hook_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "typo_in_hook.py").write_text(
        "import labcrane\n@labcrane.hookimpl\ndef labcrane_dynamic(): return []\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(PluginError, match="unknown hook 'labcrane_dynamic' in plugin"):
        discover([point("typo", "typo_in_hook")])
