"""What is told of plugins before they are used: the schema for editors, and one offer's sheet."""

import copy
import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from needs import needs
from ruamel.yaml import YAML

from labcrane.protocol.json_schema import protocol_schema
from labcrane.registry.hookspecs import ROLES
from labcrane.testing import discover, load, main

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator

ROOT = Path(__file__).parents[2]
PROTOCOLS = sorted((ROOT / "protocols").glob("*/protocol.yaml"))


@pytest.fixture(scope="module")
def schema() -> "Draft202012Validator":
    from jsonschema import Draft202012Validator  # loads for a second and a half, grammars and all

    made = protocol_schema(discover())
    Draft202012Validator.check_schema(made)
    return Draft202012Validator(made)


def written(path: Path) -> dict:
    return json.loads(json.dumps(YAML(typ="safe").load(path.read_text(encoding="utf-8"))))


@pytest.mark.parametrize("path", PROTOCOLS, ids=lambda path: path.parent.name)
def test_bundled_protocols_validate(path: Path, schema: "Draft202012Validator") -> None:
    load(path, discover())  # labcrane itself agrees
    assert [error.message for error in schema.iter_errors(written(path))] == []


WRONG = {
    "an unknown key": (("raet_hz",), 240, "'raet_hz' was unexpected"),
    "an unknown setting": (("feedback", "ball", "fra"), 4.0, "'fra' was unexpected"),
    "a setting of another offer": (("feedback", "tone", "at"), "tip", "'at' was unexpected"),
    "an unknown offer": (("feedback", "ball", "use"), "spere", "'spere' is not one of"),
    "a number out of range": (("feedback", "ball", "far"), -1.0, "-1.0 is less than or equal to"),
    "a view as a task": (("tasks", "aiming", "use"), "view", "'view' is not one of"),
    "an unknown step": (("sessions", 0, "steps"), [{"blok": {}}], "is not valid under any"),
    "a step without a task": (("sessions", 0, "steps"), [{"block": {}}], "is not valid under any"),
}


@pytest.mark.parametrize("mistake", WRONG)
def test_a_mistake_does_not_validate(mistake: str, schema: "Draft202012Validator") -> None:
    place, value, message = WRONG[mistake]
    protocol = copy.deepcopy(written(ROOT / "protocols" / "aiming" / "protocol.yaml"))
    node = protocol
    for step in place[:-1]:
        node = node[step]
    node[place[-1]] = value
    told = [error.message for error in schema.iter_errors(protocol)]
    assert len(told) == 1
    assert message in told[0]


def test_schema_is_written_for_an_editor(tmp_path: Path) -> None:
    assert main(["schema", "--out", str(tmp_path / "protocol.schema.json")]) == 0
    made = json.loads((tmp_path / "protocol.schema.json").read_text(encoding="utf-8"))
    far = made["properties"]["feedback"]["additionalProperties"]["allOf"]
    (sphere,) = (
        each["then"] for each in far if each["then"]["properties"]["use"] == {"const": "sphere"}
    )
    assert "in metres" in sphere["properties"]["far"]["description"]


def test_show_tells_settings_with_units_and_defaults_signals_and_an_example(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["plugins", "show", "sphere", "--json"]) == 0
    (sheet,) = json.loads(capsys.readouterr().out)
    far = next(each for each in sheet["settings"] if each["name"] == "far")
    assert far["default"] == "4.0"
    assert far["possible"] == "number above 0"
    assert "in metres" in far["meaning"]
    recorded = {each["column"]: (each["unit"], each["where"]) for each in sheet["recorded"]}
    assert recorded["radius"] == ("m", "every frame presented")
    assert main(["plugins", "show", "sphere"]) == 0
    said = capsys.readouterr().out
    for word in ("smallest", "target, tip", "0.15", "every frame presented", "use: sphere"):
        assert word in said


@pytest.mark.slow
@needs("mujoco", "pybullet")
def test_every_offer_can_be_shown_and_its_example_is_what_a_protocol_takes(
    schema: "Draft202012Validator", capsys: pytest.CaptureFixture[str]
) -> None:
    for offers in discover().offers.values():
        for name in offers:
            assert main(["plugins", "show", name, "--json"]) == 0
            for sheet in json.loads(capsys.readouterr().out):
                if "..." in sheet["example"] or sheet["role"] == "exporter":
                    continue  # something has to be given, or it is a command
                protocol = written(ROOT / "protocols" / "aiming" / "protocol.yaml")
                protocol |= YAML(typ="safe").load(sheet["example"])
                told = [error.message for error in schema.iter_errors(protocol)]
                assert told == [], sheet["example"]


def test_what_is_not_there_is_not_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plugins", "show", "spere"]) == 1
    assert "nothing called 'spere' is installed; did you mean 'sphere'?" in capsys.readouterr().err


@needs("mujoco")
def test_lists_checks_and_plans_are_there_for_programs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    protocol = ROOT / "protocols" / "aiming" / "protocol.yaml"
    assert main(["plugins", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert {each["role"] for each in listed["offers"]} == {entry.word for entry in ROLES.values()}
    assert listed["broken"] == {}
    assert main(["check", str(protocol), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["fine"] is True
    wrong = tmp_path / "protocol.yaml"
    wrong.write_text(
        protocol.read_text(encoding="utf-8")
        .replace("sphere", "spere")
        .replace("far: 4.0}", "fra: 4}"),
        encoding="utf-8",
    )
    assert main(["check", str(wrong), "--json"]) == 2
    problems = json.loads(capsys.readouterr().out)["problems"]
    assert any("cue 'spere' is not installed; did you mean 'sphere'" in each for each in problems)
    assert main(["plan", str(protocol), "--participants", "2", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["balance"], "of all who are planned"
    plans = told["sessions"]
    assert [each["participant"] for each in plans] == ["P001", "P002"]
    assert all(block["trials"] == 32 for each in plans for block in each["blocks"])
