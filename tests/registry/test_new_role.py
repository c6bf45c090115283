"""A role is a class, a hook and a row of the table; all else follows."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType

import pytest
from needs import needs

import labcrane
from labcrane import FloatArray, LabcraneError, Machine, Offer, PluginError
from labcrane.core.roles import Component
from labcrane.core.signals import Signal
from labcrane.machines.library import load_machine
from labcrane.protocol.json_schema import protocol_schema
from labcrane.protocol.study import load
from labcrane.registry.description import sheets
from labcrane.registry.hookspecs import NUMBERS, ROLES, RoleEntry, hookspec
from labcrane.registry.offers import Settings, offer
from labcrane.registry.registry import Registry, discover
from labcrane.registry.scaffold import write_plugin

ROOT = Path(__file__).parents[2]
STUDY = ROOT / "tests" / "recording" / "before" / "protocol.yaml"


class LampDriver(Component):
    """What shines on the operator."""

    @abstractmethod
    def shine(self, tick: int, brightness: Sequence[float]) -> FloatArray:
        """Return how brightly it shone, shape ``(n_signals,)``."""


@hookspec
def labcrane_lamps() -> list[Offer[LampDriver]]:
    """Offer lamps."""
    raise NotImplementedError


class BulbSettings(Settings):
    """A bulb."""

    power: float = 40.0
    """In watts."""


class Bulb(LampDriver):
    """Glows."""

    signals = (Signal("brightness", "lx"),)

    def shine(self, tick, brightness):
        return list(brightness)


@pytest.fixture(params=[True, False], ids=["several", "one"])
def row(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> RoleEntry:
    entry = RoleEntry(
        labcrane_lamps,
        "lamp",
        "a lamp that shines on the operator",
        ("lamps",),
        several=request.param,
        returns={"shine": NUMBERS},
    )
    monkeypatch.setitem(ROLES, LampDriver, entry)
    monkeypatch.setattr(labcrane, "LampDriver", LampDriver, raising=False)
    monkeypatch.setattr(labcrane, "__all__", [*labcrane.__all__, "LampDriver"])
    return entry


@pytest.fixture
def registry(row: RoleEntry, monkeypatch: pytest.MonkeyPatch) -> Iterator[Registry]:
    plugin = ModuleType("bulbs")
    plugin.labcrane_api = 1
    plugin.labcrane_lamps = labcrane.hookimpl(_labcrane_lamps)
    monkeypatch.setitem(sys.modules, "bulbs", plugin)

    installed = [*entry_points(group="labcrane"), EntryPoint("bulbs", "bulbs", "labcrane")]
    return discover(installed)


def _labcrane_lamps() -> list[Offer[LampDriver]]:
    return [offer("bulb", BulbSettings, lambda settings, machine: Bulb())]


_labcrane_lamps.__name__ = "labcrane_lamps"


def imported(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def study(folder: Path, row: RoleEntry, use: str) -> Path:
    path = folder / "protocol.yaml"
    path.write_text(
        STUDY.read_text(encoding="utf-8")
        + f"lamps: {'{desk: ' + use + '}' if row.several else use}\n",
        encoding="utf-8",
    )
    return path


def test_a_protocol_uses_it_and_the_record_names_it(
    registry: Registry, row: RoleEntry, tmp_path: Path
) -> None:
    chosen = load(study(tmp_path, row, "{use: bulb, power: 60}"), registry)
    part = "lamps.desk" if row.several else "lamps"
    described = chosen.choices[part].described(tmp_path)
    assert described == {"use": "bulb", "plugin": "bulbs", "settings": {"power": 60.0}}


def test_mistakes_are_named_with_their_line(
    registry: Registry, row: RoleEntry, tmp_path: Path
) -> None:
    for use, words in (
        ("{use: bulbb}", "lamp 'bulbb' is not installed; did you mean 'bulb'?"),
        ("{use: bulb, power: much}", "power"),
        ("{use: bulb, colour: red}", "colour"),
    ):
        with pytest.raises(LabcraneError) as refused:
            load(study(tmp_path, row, use), registry)
        line = len(STUDY.read_text(encoding="utf-8").splitlines()) + 1
        assert f"protocol.yaml:{line}:" in str(refused.value)
        assert words in str(refused.value)


def test_what_it_returns_is_checked_and_named(
    registry: Registry, row: RoleEntry, tmp_path: Path
) -> None:
    chosen = load(study(tmp_path, row, "{use: bulb}"), registry)
    (choice,) = (each for part, each in chosen.choices.items() if part.startswith("lamps"))
    built = choice.build(load_machine("ch8"))
    assert isinstance(built, LampDriver)
    with pytest.raises(PluginError, match=r"lamp 'bulb' of plugin 'bulbs'.*shine.*returned list"):
        built.shine(1, [2.0])


def test_editors_are_told_of_its_key(registry: Registry, row: RoleEntry) -> None:
    key = protocol_schema(registry)["properties"]["lamps"]
    use = key["additionalProperties"] if row.several else key
    assert use["properties"]["use"] == {"enum": ["bulb"]}
    (which,) = use["allOf"]
    assert which["then"]["properties"]["power"]["description"] == "In watts."


def test_its_offers_are_described(registry: Registry, row: RoleEntry) -> None:
    (sheet,) = sheets(registry, "bulb", load_machine("ch8"))
    assert (sheet.role, sheet.plugin) == ("lamp", "bulbs")
    assert [each.where for each in sheet.recorded or ()] == ["every tick"]
    assert sheet.example.startswith("lamps:\n")
    assert sheet.example.endswith("use: bulb\n" + "  " * (1 + row.several) + "power: 40.0")


@needs("pybullet")
def test_its_page_of_the_reference_is_generated(
    registry: Registry, row: RoleEntry, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = ROOT / "docs" / "generate.py"
    module = imported("generate", where)
    monkeypatch.setattr(module, "discover", lambda: registry)
    page = dict(module.plugin_pages())["lamp"]
    assert "What shines on the operator." in page
    assert "| `power` | number | `40.0` | In watts. |" in page
    assert "| `brightness` | lx | one number |" in page
    assert "`lamps`" in module.protocol_page()


def test_a_plugin_of_it_is_scaffolded(
    registry: Registry, row: RoleEntry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_plugin("lamp", "my_lamp", tmp_path, registry)
    assert write_plugin("lamp_driver", "other", tmp_path, registry).exists()
    tidy = ["check", "--isolated", "--line-length=100"], ["format", "--check", "--isolated"]
    for arguments in tidy:
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *arguments, folder], check=False, capture_output=True
        )
        assert done.returncode == 0, done.stdout
    module = imported("labcrane_my_lamp", folder / "labcrane_my_lamp.py")
    monkeypatch.setitem(sys.modules, "labcrane_my_lamp", module)
    (made,) = module.labcrane_lamps()
    component = made.build(made.settings(), Machine)
    assert isinstance(component, LampDriver)
    with pytest.raises(NotImplementedError):
        component.shine(1, [1.0])
    again = discover([EntryPoint("my_lamp", "labcrane_my_lamp", "labcrane")])
    assert list(again.offers[LampDriver]) == ["my_lamp"]
    assert "lamps:" in (folder / "protocol.yaml").read_text(encoding="utf-8")
