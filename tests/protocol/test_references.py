"""What a protocol's components refer to: looked up by the core, told with place and remedy."""

# ruff: noqa: E501 - a message is one line, as the researcher sees it

import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import pytest
from rehearsal import SHORT, said_of

import labcrane
from labcrane import InputDevice, ProtocolError, Settings
from labcrane.core import ButtonName, Covers, JointName, Layout, Once, Reference
from labcrane.core.events import CODES, KINDS
from labcrane.core.references import Mentioned, mentioned
from labcrane.machines import load_machine
from labcrane.protocol.protocol import Participants
from labcrane.protocol.questions import questions
from labcrane.testing import Registry, discover, load

PROTOCOLS = Path(__file__).parents[2] / "protocols"

AIMING = (PROTOCOLS / "aiming" / "protocol.yaml").read_text(encoding="utf-8")
AIMING = "#\n#\n\n" + AIMING[AIMING.index("labcrane: 1") :]  # whatever is said above it
RETRIEVAL = (PROTOCOLS / "retrieval" / "protocol.yaml").read_text(encoding="utf-8")
RETRIEVAL = "#\n#\n\n" + RETRIEVAL[RETRIEVAL.index("labcrane: 1") :]


@pytest.fixture
def told(tmp_path: Path, registry: Registry):
    """Return what is said of a protocol beside the files of the shipped one, its name left out."""

    def tell(study: str, text: str) -> list[str]:
        folder = tmp_path / study
        if not folder.exists():
            shutil.copytree(PROTOCOLS / study, folder)
        return said_of(folder / "protocol.yaml", text, registry)

    return tell


@pytest.mark.parametrize(
    ("study", "old", "new", "said"),
    [
        ("aiming", "right.x", "right.z", "14:46: scheme.map.wrist is '-right.z', and there is no such axis; did you mean"),
        ("aiming", ", wrist: -right.x", "", "14:8: scheme.map has nothing for the joint 'wrist'; it needs one for each of slew, shoulder, elbow, wrist"),
        ("aiming", "elbow: left.y", "boom: left.y", "14:24: scheme.map.boom is 'boom', and there is no such joint; the machine has elbow, shoulder, slew, wrist"),
        ("retrieval", "proportional: [base]", "proportional: [foo]", "17:18: dynamics.proportional[1] is 'foo', and there is no such joint; the machine has arm, base, boom, jaws"),
        ("retrieval", "boom: 3", "bom: 3", "11:72: input.valves.bom is 'bom', and there is no such joint; did you mean 'boom'?"),
        ("retrieval", "boom: 3, ", "", "13:9: scheme needs the axis 'valve.boom', and there is no such axis"),
        ("retrieval", "fov_deg: 66}", "fov_deg: 66, on: bom}", "38:91: views.operator.camera.on is 'bom', and there is no such link; did you mean 'boom'?"),
        ("aiming", "end: rest_inside", "trigger: left.knob", "20:85: tasks.aiming.trigger is 'left.knob', and there is no such button;"),
        ("aiming", "end: rest_inside", "trigger: left.x", "20:85: tasks.aiming.trigger is 'left.x', and there is no such button; the input has left.trigger, right.trigger"),
        ("retrieval", "find_axis: float.base", "find_axis: valve.base", "32:16: tasks.retrieval.find_axis is 'valve.base', and there is no such button; did you mean 'float.base'?"),
        ("retrieval", "    scenes: *scenes", "    scenes: [scenes/carry.yaml, scenes/carry.yaml]", "30:33: two scenes are called 'carry'; list each once, or rename a file"),
        ("aiming", "machine: ch8", "machine: {urdf: arm.urdf, joints: [a, b, c], tip: t}", "10:17: machine file"),
        ("retrieval", "button: float.base", "button: float.bas", "12:57: operator.button is 'float.bas', and there is no such button; did you mean 'float.base'?"),
        ("aiming", "camera: cab}", "camera: top, beside: [cap]}", "27:47: views.operator.beside[1]: there is no such camera as 'cap'; did you mean 'cab'? there is cab, cab_left, cab_right, free, top"),
        ("aiming", "camera: cab", "keys: [a, lft]", "27:35: views.operator.keys[2] is 'lft', and there is no such key; did you mean 'lshift'?"),
        ("aiming", "input: {use: dual_joystick}", "input: {use: keyboard, view: operator, axes: {slew: [a, d]}}", "11:54: input.axes.slew[1] is 'a', and there is no such key of that view; it has none"),
        ("retrieval", "look: [0.8, ", "look: [true, ", "38:56: views.operator.camera.look[1]: true is not a number; write one"),
        ("aiming", "camera: cab", "areas: [targt]", "27:33: views.operator.areas[1] is 'targt', and there is no such object; did you mean 'target'?"),
        ("aiming", "camera: cab", "patch: {on: [trial.strat]}", "27:38: views.operator.patch.on[1] is 'trial.strat', and there is no such event; did you mean 'trial.start'?"),
        ("aiming", "camera: cab", "supervisor: {cameras: [moon]}", "27:48: views.operator.supervisor.cameras[1] is 'moon', and there is no such camera;"),
        ("aiming", "wrist: -right.x", "wrist: -left.y", "14:46: scheme.map has 'left.y' for both 'elbow' and 'wrist'; give each its own"),
        ("aiming", "width: 0.5", "width: 50", "20:57: tasks.aiming.width: a circle 50 m wide holds the middle of its partner 2 m away; write less than 2"),
        ("aiming", "width: 0.5", "width: 1e300", "20:57: tasks.aiming.width: a circle 1e+300 m wide"),
        ("aiming", "width: 0.5", "width: 2", "20:57: tasks.aiming.width: a circle 2 m wide"),
        ("aiming", "[2, 3, 4, 6]", "[1,5, 2,5, 4]", "20:36: tasks.aiming.distances: 5 m is listed twice; write each distance once, and decimals with a point: [1.5, 2.5, 4]"),
        ("aiming", "[2, 3, 4, 6]", "2 m", "20:36: tasks.aiming.distances is '2 m'; it must be a list: [.., ..]"),
        ("aiming", "feedback: group", "feedback: grup", "39:41: sessions[1].steps[2].block.feedback: it is 'grup'; did you mean 'group'?"),
        ("aiming", "on_fault", "  - {name: acquisition, steps: [consent]}\non_fault", "41:12: two sessions are called 'acquisition'; give each a name of its own"),
        ("aiming", "pattern: 'P\\d{3}'", "pattern: 'P\\d{3}$1'", "7:25: participants.pattern 'P\\d{3}$1' matches no name; "),
        ("aiming", "use: joint_velocity\n  map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}", "use: end_effector\n  map: {x: left.x, y: left.y, up: right.y}", "14:31: scheme.map.up is 'up', and there is no such direction of the frame; it has x, y, z"),
        ("aiming", "use: joint_velocity\n  map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}", "use: end_effector\n  map: {x: left.x, y: left.y}", "14:8: scheme.map has nothing for the direction of the frame 'z'; it needs one for each of x, y, z"),
        ("retrieval", "model: arm.dmd.yaml\n  prop", "model: avc.dbc\n  prop", "16:10: "),
        ("retrieval", "jaws: {grip_n: 60", "jaws: {joint: boom, grip_n: 60", "18:17: the jaws' joint 'boom' must be the machine's last and have length 0, but the last is 'jaws'"),
        ("retrieval", "proportional: [base]", "proportional: [base, base]", "17:24: dynamics.proportional has 'base' twice; write it once"),
        ("aiming", "pattern: 'P\\d{3}'", 'pattern: "P\\d{3}"', "7:28: this is not valid YAML: a backslash in double quotation marks starts an escape sequence; use single quotation marks: 'P\\d{3}'"),
        ("aiming", "  map:", "\tmap:", "14:1: there is a tab, which YAML does not accept as indentation; use spaces"),
    ],
)  # fmt: skip
def test_a_name_of_nothing_is_told_where_it_stands(
    told, study: str, old: str, new: str, said: str
) -> None:
    text = AIMING if study == "aiming" else RETRIEVAL
    assert old in text
    lines = told(study, text.replace(old, new, 1))
    assert [line for line in lines if line.startswith(said)], lines
    assert {line.split(":")[0] for line in lines} <= {said.split(":", maxsplit=1)[0], "13", "14"}, (
        lines
    )


STICK = """
from labcrane import InputDevice, Settings, Signal, hookimpl, offer

labcrane_api = 1


class Stick(InputDevice):
    signals = (Signal("stick", "1", ("x", "y", "twist")), Signal("button", "1"))

    def __init__(self, settings, machine):
        pass

    def read(self, tick, seen):
        raise NotImplementedError


class StickSettings(Settings):
    def provides(self, machine):
        return {"button": ("button",)}


@hookimpl
def labcrane_inputs():
    return [offer("one_stick", StickSettings, Stick)]
"""


def test_a_stick_with_fewer_axes_than_joints_is_told_what_can_be_done(tmp_path: Path) -> None:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "one_stick.py").write_text(STICK, encoding="utf-8")
    path = tmp_path / "protocol.yaml"
    path.write_text(
        SHORT.replace("input: {use: dual_joystick}", "input: {use: one_stick}").replace(
            "map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}",
            "map: {slew: -stick.x, elbow: stick.y, wrist: -stick.twist}",
        ),
        encoding="utf-8",
    )
    with pytest.raises(ProtocolError) as refused:
        load(path, discover(study=path))
    said = str(refused.value)
    assert "has nothing for the joint 'shoulder'; it needs one for each of slew, shoulder" in said
    assert "the input has 3 axes; with three, use: end_effector moves the tip" in said


def test_a_scene_that_the_dynamics_has_not_is_told(told) -> None:
    text = RETRIEVAL.replace("    - scenes/touch.yaml\n", "", 1)
    (line,) = told("retrieval", text.replace("*scenes", "[scenes/carry.yaml, scenes/touch.yaml]"))
    assert line == (
        "29:33: tasks.retrieval.scenes[2] is 'touch', and there is no such scene; the dynamics has "
        "carry, casualty, extract, reach_over, reach_through"
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("joint2", "joint22", "10:74: {}: there is no joint 'joint22'; did you mean 'joint2'? it has joint1,"),
        ("gripper", "griper", "10:118: {}: there is no link 'griper'; did you mean 'gripper'? it has base,"),
        ("{elbow: 60}", "{elbo: 60}", "10:144: rest_deg names 'elbo'; did you mean 'elbow'? its joints are slew,"),
        ("{elbow: 60}", "{elbow: 600}", "10:145: {} as a machine: joint 'elbow': rest_deg 600 is outside the joint's range; it must be -54 to 79.2"),
        ("_x.urdf", "_y.urdf", "10:17: machine file {!r} does not exist; paths are relative to"),
    ],
)  # fmt: skip
def test_a_wrong_name_of_a_robots_file_is_told_where_the_protocol_has_it(
    told, tmp_path: Path, old: str, new: str, said: str
) -> None:
    machine = (
        "machine: {urdf: openmanipulator_x.urdf, joints: {slew: joint1, shoulder: joint2, "
        "elbow: joint3, wrist: joint4}, tip: gripper, rest_deg: {elbow: 60}}"
    )
    right = AIMING.replace("machine: ch8", machine).replace("[2, 3, 4, 6], width: 0.5", NEAR)
    right = right.replace("mujoco_crane, actuator: ideal", "kinematic_crane")
    assert told("aiming", right)[0].count("openmanipulator_x.urdf' does not exist") == 1
    folder = tmp_path / "aiming"
    shutil.copy(PROTOCOLS.parent / "examples" / "machines" / "openmanipulator_x.urdf", folder)
    assert told("aiming", right) == []
    (line,) = told("aiming", right.replace(old, new, 1))
    file = folder / ("openmanipulator_y.urdf" if "_y" in new else "openmanipulator_x.urdf")
    assert line.startswith(said.format(str(file))), line


NEAR = "[0.1], width: 0.02, centre: [0.2, 0, 0.1]"
"""Circles in reach of an arm for a table."""


OWN = (
    "questionnaires: {q: {use: free, title: Q, questions: [{name: a, text: A, %s}], %s}}\non_fault"
)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("use: sphere", "use: sphere, colour: [40, 190, 255]", "feedback.ball.colour[1] is 40; it must be less than or equal to 1"),
        ("camera: cab}", "camera: {eye: [1, 2, 3], look: [1, 2, 3]}}", "look and eye are the same point; write another"),
        ("camera: cab}", "patch: {on: []}}", "views.operator.patch.on is []; it needs at least 1"),
        ("camera: cab}", "patch: {on: [trial.end, trial.end]}}", "views.operator.patch.on has 'trial.end' twice; write it once"),
        ("camera: cab}", "areas: [tip, tip]}", "views.operator.areas has 'tip' twice; write it once"),
        ("camera: cab}", "screens: [1, 1]}", "views.operator.screens has '1' twice; write it once"),
        ("camera: cab}", "hud: [block, block]}", "views.operator.hud has 'block' twice; write it once"),
        ("on_fault", "page: {host: '127.0.0.1:80'}\non_fault", "page.host: '127.0.0.1:80' is not an address; "),
        ("on_fault", "page: {host: http://lab}\non_fault", "page.host: 'http://lab' is not an address; "),
        ("on_fault", "page: {colour: blue}\non_fault", "page.colour is 'blue'; it must be red, green and blue in hexadecimal,"),
        ("on_fault", OWN % ("kind: choice, choices: [x, y, x]", ""), "'x' is listed twice; write each once"),
        ("on_fault", OWN % ("choices: [x, y]", ""), "has choices, and its kind is 'scale'; write kind: choice, or leave"),
        ("on_fault", OWN % ("step: 1", "sums: {s: [b]}"), "questionnaires.q.sums.s[1] is 'b', and there is no such question with numbers; it has a"),
        ("on_fault", OWN % ("kind: text", "sums: {s: [a]}"), "is 'a', and there is no such question with numbers; it has none"),
        ("on_fault", OWN % ("step: 1", "sums: {s: [a, a]}"), "questionnaires.q.sums.s has 'a' twice; write it once"),
        ("on_fault", OWN % ("step: 1", "sums: {s: []}"), "questionnaires.q.sums.s is []; it needs at least 1"),
        ("on_fault", "operator: {use: simulated_operator, axes: [-left.x]}\non_fault", "'-left.x' is reversed, but only a scheme's map can"),
        ("on_fault", "operator: {use: simulated_operator, button: left.trigger}\non_fault", "button is given without axes"),
        ("on_fault", "operator: {use: simulated_operator, axes: [left.w]}\non_fault", "operator.axes[1] is 'left.w', and there is no such axis of the input; did you mean 'left.y'?"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_told_in_its_line(told, old: str, new: str, said: str) -> None:
    assert old in AIMING
    line = AIMING[: AIMING.index(old)].count("\n") + 1
    lines = told("aiming", AIMING.replace(old, new, 1))
    assert [each for each in lines if each.startswith(f"{line}:") and said in each], lines
    assert {each.split(":")[0] for each in lines} == {str(line)}, lines


def test_a_crane_that_has_no_scenes_is_told_with_the_task_that_needs_one(told) -> None:
    arm = RETRIEVAL[RETRIEVAL.index("  use: dmd_arm") : RETRIEVAL.index("tasks:")]
    text = RETRIEVAL.replace(arm, "  use: kinematic_crane\n\n")
    lines = told("retrieval", text.replace("*scenes", "[scenes/carry.yaml]", 1))
    said = "tasks.retrieval.scenes[1] is 'carry', and there is no such scene; the dynamics has none"
    assert [line for line in lines if line.endswith(said)], lines


def test_a_scene_of_another_folder_is_told_from_that_of_the_dynamics(told, tmp_path: Path) -> None:
    assert told("retrieval", RETRIEVAL) == []
    (tmp_path / "retrieval" / "other").mkdir()
    scene = tmp_path / "retrieval" / "scenes" / "carry.yaml"
    shutil.copytree(scene.parent, tmp_path / "retrieval" / "other" / "scenes")
    (line,) = told("retrieval", RETRIEVAL.replace("*scenes", "[other/scenes/carry.yaml]"))
    assert line.endswith(
        f"tasks.retrieval.scenes[1] is 'carry', and the dynamics has another file of that name, "
        f"{scene}; name the same one"
    )
    assert told("retrieval", RETRIEVAL.replace("*scenes", "[scenes/../scenes/carry.yaml]")) == []


PLUGIN = """
from typing import Annotated

from labcrane import Questionnaire, Settings, SignalMonitor, hookimpl, offer
from labcrane.core import Covers, EventName, Item, Reference

labcrane_api = 1

class Part(Settings):
    words: Annotated[dict[Annotated[str, Reference("word", own=True)], int], Covers("word", own=True)]
    def provides(self, machine):
        return {"word": ("yes", "no")}

class WhenSettings(Settings):
    on: EventName = "trial.end"
    part: Part | None = None
    def provides(self, machine):
        return {"word": ("outer",)}

class When(Questionnaire):
    title, rights = "When", "ours"
    def items(self):
        return [Item("a", "A?")]
    def score(self, answers):
        return {}

class Look(SignalMonitor):
    def knows(self, stream): return False
    def begin(self, stream): pass
    def look(self, times, samples): return ()

@hookimpl
def labcrane_questionnaires():
    return [offer("when", WhenSettings, lambda settings, machine: When())]

@hookimpl
def labcrane_monitors():
    return [offer("when_seen", WhenSettings, lambda settings, machine: Look())]
"""


@pytest.mark.parametrize(("key", "use"), [("questionnaires", "when"), ("monitors", "when_seen")])
@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("on: trial.end", ""),
        ("on: trial.ent", "{}.q.on is 'trial.ent', and there is no such event; did you mean 'trial.end'?"),
        ("part: {words: {yes: 1, no: 2}}", ""),
        ("part: {words: {yes: 1, 'no': 2, outer: 3}}", "{}.q.part.words.outer is 'outer', and there is no such word; it has no, yes"),
        ("part: {words: {yes: 1}}", "{}.q.part.words has nothing for the word 'no'; it needs one for each of no, yes"),
    ],
)  # fmt: skip
def test_types_of_a_plugin_of_the_study_are_looked_up_wherever_it_is_used(
    tmp_path: Path, key: str, use: str, written: str, said: str
) -> None:
    folder = tmp_path / "study"
    shutil.copytree(PROTOCOLS / "aiming", folder)
    (folder / "plugins").mkdir()
    (folder / "plugins" / "when.py").write_text(PLUGIN, encoding="utf-8")
    path = folder / "protocol.yaml"
    new = f"{key}: {{q: {{use: {use}, {written}}}}}\non_fault"
    path.write_text(AIMING.replace("on_fault", new, 1), encoding="utf-8")
    registry = discover(study=path)
    if not said:
        load(path, registry)
        return
    with pytest.raises(ProtocolError) as refused:
        load(path, registry)
    assert said.format(key) in str(refused.value)


def test_the_scheme_that_the_scaffold_writes_has_its_axes_looked_up(
    tmp_path: Path,
) -> None:
    template = Path(labcrane.__file__).parent / "registry" / "templates" / "scheme" / "my_module.py"
    folder = tmp_path / "study"
    shutil.copytree(PROTOCOLS / "aiming", folder)
    (folder / "plugins").mkdir()
    (folder / "plugins" / "mine.py").write_text(template.read_text(encoding="utf-8"))
    path = folder / "protocol.yaml"
    old = AIMING[AIMING.index("scheme:") : AIMING.index("dynamics:")]
    registry = None
    for axes, said in (
        ("left.x, right.y, left.y, right.x", ""),
        ("left.x, right.y, left.y, right.z", "scheme.axes[4] is 'right.z', and there is no such axis; did you"),
        ("left.x, left.y, left.y, right.x", "scheme.axes has 'left.y' twice; write it once"),
    ):  # fmt: skip
        new = f"scheme: {{use: my_part, axes: [{axes}]}}\n"
        path.write_text(AIMING.replace(old, new, 1), encoding="utf-8")
        registry = registry or discover(study=path)
        if not said:
            load(path, registry)
            continue
        with pytest.raises(ProtocolError) as refused:
            load(path, registry)
        assert said in str(refused.value)


def test_a_session_without_steps_is_told(told) -> None:
    text = AIMING[: AIMING.index("    steps:")] + "    steps: []\n"
    assert any(
        line.endswith("sessions[1].steps is []; it needs at least 1")
        for line in told("aiming", text)
    )


def test_all_wrong_names_are_told_at_once(told) -> None:
    text = AIMING.replace("left.x", "left.q").replace("camera: cab", "camera: cab, areas: [tipp]")
    assert [line.split(":")[0] for line in told("aiming", text)] == ["14", "27"]


def test_a_file_in_another_encoding_is_told_to_be_saved_as_utf_8(
    tmp_path: Path, registry: Registry
) -> None:
    path = tmp_path / "study.yaml"
    path.write_bytes("labcrane: 1\ntitle: Übung\n".encode("latin-1"))
    said = r"study\.yaml:2:8: byte 0xDC is not UTF-8; .* save it as"
    with pytest.raises(ProtocolError, match=said):
        load(path, registry)


@pytest.mark.parametrize(
    ("pattern", "ends_early"),
    [
        (r"P\d{3}$", False),
        (r"^P\d{3}$", False),
        (r"(?:^P)\d+", False),
        (r"P$x|P\d{3}", False),
        (r"P\$1", False),
        (r"[$^]P", False),
        (r"P$\d*", False),
        (r"P\d{3}$1", True),
        (r"P^\d{3}", True),
    ],
)
def test_a_pattern_with_something_behind_its_end_is_told_from_one_without(
    pattern: str, ends_early: object
) -> None:
    assert Participants(pattern=pattern).ends_early is ends_early
    if ends_early:
        assert not any(
            re.fullmatch(pattern, f"P{n:03}{tail}") for n in range(1000) for tail in ("", "1")
        )


class Finger(Settings):
    """A part of the settings below."""

    button: ButtonName = "left.trigger"


class Hand(Settings):
    """What a plugin's author might write."""

    fingers: tuple[Finger, ...] = ()
    pair: tuple[ButtonName, JointName] | None = None
    map: Annotated[dict[JointName, float], Covers("joint"), Once()] | None = None
    maybe: ButtonName | None = None


def test_a_marked_name_is_found_however_deep_it_stands_and_a_default_is_left_out() -> None:
    hand = Hand.model_validate(
        {"fingers": [{}, {"button": "a"}], "pair": ["b", "slew"], "map": {"boom": 1}}
    )
    button, joint = Reference("button"), Reference("joint")
    assert list(mentioned(hand)) == [
        Mentioned(button, ("fingers", 1, "button"), "a"),
        Mentioned(button, ("pair", 0), "b"),
        Mentioned(joint, ("pair", 1), "slew"),
        Mentioned(Covers("joint"), ("map",), {"boom": 1.0}),
        Mentioned(Once(), ("map",), {"boom": 1.0}),
        Mentioned(joint, ("map", "boom"), "boom", key=True),
    ]


INPUTS: Mapping[str, dict[str, Any]] = {
    "dual_joystick": {},
    "simulated_operator": {},
    "simulated_operator with axes": {"axes": ["keyboard.a", "keyboard.b"], "button": "keyboard.c"},
    "scenario_operator": {},
    "gateway": {},
    "keyboard": {"view": "v", "axes": {"slew": ["a", "d"]}},
    "can": {"bus": "socketcan:can0", "valves": {"arm": 1, "boom": 2}},
}


@pytest.mark.parametrize("name", INPUTS)
def test_an_input_declares_the_axes_that_it_has(registry: Registry, name: str) -> None:
    offer = registry.find(InputDevice, name.split(maxsplit=1)[0])
    machine = load_machine(str(PROTOCOLS / "retrieval" / "ied_arm.yaml"), PROTOCOLS)
    settings = offer.settings.model_validate(INPUTS[name])
    built = offer.build(settings, machine)
    assert tuple(settings.provides(machine)["axis"]) == Layout("the input", built.signals).columns


def test_a_protocol_may_name_every_event_that_its_session_sends_and_no_other(told) -> None:
    protocol = (PROTOCOLS / "aiming" / "protocol.yaml").read_text(encoding="utf-8")
    of_aiming = {"targets.shown", "target.entered", "command.onset", "movement.onset",
                 "movement.offset", "tap.ignored"}  # fmt: skip
    codes = ", ".join(f"{name}: {code}" for name, code in CODES.items())
    line = f"triggers: {{line: {{use: serial_ttl, port: x, codes: {{{codes}}}}}}}\n"
    refused = list(told("aiming", protocol + line))
    others = {name for name in CODES if KINDS[name].task} - of_aiming
    assert len(refused) == len(others)
    assert all(any(f"'{name}'" in said for said in refused) for name in others)


@pytest.mark.parametrize(
    ("study", "old", "new", "said"),
    [
        ("aiming", "wrist: -right.x, shoulder: -right.y}\n  dead_zone: 0.05", "wrist: right.z, shoulder: -right.y}\n  dead_zone: much", ["scheme.map.wrist is 'right.z'", "scheme.dead_zone is 'much'"]),
        ("aiming", "end: rest_inside, limit_s: 30", "end: trigger, trigger: left.knob, limit_s: 3 parsnips", ["tasks.aiming.trigger is 'left.knob'", "tasks.aiming.limit_s"]),
        ("aiming", "camera: cab", "areas: [targt], size: [1280, much], keys: [lft]", ["views.operator.areas[1] is 'targt'", "views.operator.size[2]", "views.operator.keys[1] is 'lft'"]),
        ("aiming", "camera: cab", "camera: {eye: [1, 2, 3], look: [3, 4, 5], fov_deg: 800, on: bom}", ["views.operator.camera.on is 'bom'", "views.operator.camera.fov_deg is 800"]),
        ("aiming", "camera: cab", "beside: [{eye: [1, 2, 3], look: [3, 4, 5], delay_s: -1, on: bom}]", ["views.operator.beside[1].on is 'bom'", "views.operator.beside[1].delay_s is -1"]),
        ("aiming", "at: target, far: 4.0", "at: target, far: -4", ["feedback.ball.far is -4"]),
    ],
)  # fmt: skip
def test_a_wrong_number_hides_no_wrong_name_of_its_component(
    told, study: str, old: str, new: str, said: Sequence[str]
) -> None:
    text = AIMING if study == "aiming" else RETRIEVAL
    assert old in text
    lines = told(study, text.replace(old, new, 1))
    found = [line.split(": ", 1)[1] for line in lines]
    assert len(found) == len(said), lines
    assert all(any(line.startswith(each) for line in found) for each in said), lines


def test_a_wrong_number_of_the_input_hides_no_wrong_axis_elsewhere(told) -> None:
    text = RETRIEVAL.replace("jaws: 4}", "jaws: 4}, timeout_s: -1", 1)
    lines = told("retrieval", text.replace("find_axis: float.base", "find_axis: float.bas", 1))
    assert any("tasks.retrieval.find_axis is 'float.bas'" in line for line in lines), lines
    assert any("input.timeout_s is -1" in line for line in lines), lines


FOLDER, EMPTY, NOISE = None, b"", b"\x00\x01noise\xff"


@pytest.mark.parametrize("holds", [FOLDER, EMPTY, NOISE], ids=["folder", "empty", "noise"])
@pytest.mark.parametrize(
    ("old", "new", "name", "said"),
    [
        ("design:", "questionnaires: {a: {use: free, file: q.yaml}}\ndesign:", "q.yaml", "30:39: "),
    ],
)  # fmt: skip
def test_a_file_that_a_run_would_open_is_looked_into(
    told, tmp_path: Path, old: str, new: str, name: str, said: str, holds: bytes | None
) -> None:
    told("aiming", AIMING)
    file = tmp_path / "aiming" / name
    file.mkdir() if holds is None else file.write_bytes(holds)
    assert AIMING.count(old) == 1
    (line,) = told("aiming", AIMING.replace(old, new))
    assert line.startswith(said), line
    assert re.search(
        "which is a folder; name|cannot be read|holds no keys; it must",
        line,
    ), line


def test_instructions_that_are_a_folder_are_told_so(told) -> None:
    (line,) = told("aiming", AIMING.replace("instructions: instructions.md", "instructions: ."))
    assert line == "38:23: instructions is '.', which is a folder; name a text file in it"


@pytest.mark.parametrize("text", ["", "\n", " \t\r\n", "\ufeff\n"])
def test_instructions_without_a_word_are_told(told, tmp_path: Path, text: str) -> None:
    assert told("aiming", AIMING) == []
    (tmp_path / "aiming" / "nothing.md").write_text(text, encoding="utf-8")
    new = "instructions: nothing.md"
    (line,) = told("aiming", AIMING.replace("instructions: instructions.md", new))
    said = "instructions is 'nothing.md', which is empty; write in it what is to be read"
    assert line == f"38:23: {said}"


def test_a_certificate_that_is_none_is_asked_about(told, tmp_path: Path, registry) -> None:
    told("aiming", "page: {certificate: a.pem, key: a.key}\n" + AIMING)
    folder = tmp_path / "aiming"
    for name in ("a.pem", "a.key"):
        (folder / name).write_text("no PEM\n", encoding="utf-8")
    asked = [
        each
        for each in questions(load(folder / "protocol.yaml", registry))
        if each.place[0] == "page"
    ]
    assert [each.key for each in asked] == ["page.certificate"]
    assert "give both in PEM, without a passphrase; is that meant?" in asked[0].text


def column_of(text: str, part: str) -> str:
    """Return line and column of a part of a text, as a message begins."""
    at = text.index(part)
    return f"{text[:at].count(chr(10)) + 1}:{at - text.rfind(chr(10), 0, at)}: "


QUESTION = "questionnaires: {a: {use: free, title: A, questions: [{name: x, text: X?, %s}]}}\n"
TRACK = "design:\n  tracks: {t: {factor: pairs, levels: {2m_far_left: 2, 4m_far_left: 4}, %s}}\n"


@pytest.mark.parametrize(
    ("old", "new", "at", "said"),
    [
        ("camera: cab", "camera: {eye: [1, 2, 3], look: [1, 2, 3]}", "[1, 2, 3]}", "look and eye are the same point"),
        ("camera: cab", "camera: {eye: [1, 2, 3], on: slew, look: targets}", "targets}", "cannot keep the targets"),
        ("camera: cab", "beside: [{eye: [1, 2, 3], look: targets, depth_m: [3, 2]}]", "[3, 2]", "must be farther away"),
        ("design:", QUESTION % "kind: choice" + "design:", "choice}", "has no choices"),
        ("design:", QUESTION % "kind: scale, choices: [a, b]" + "design:", "[a, b]", "has choices"),
        ("design:", QUESTION % "lowest: 20" + "design:", "20}", "must rise"),
        ("design:", QUESTION % "lowest: 2, highest: 1" + "design:", "1}", "must rise"),
        ("design:", QUESTION % "kind: text}, {name: x, text: Y?" + "design:", "x, text: Y?", "is the name of two questions"),
        ("design:", TRACK % "up_down: {}, quest_plus: {spreads: [1]}", "{spreads", "both are there"),
        ("design:", TRACK % "up_down: {}, measure: movement_time", "movement_time}}", "write the limit as well"),
        ("design:", TRACK % "up_down: {}, at_most: 9", "9}}", "write the measure as well"),
        ("design:", TRACK % "up_down: {}, measure: movement_time, at_least: 3, at_most: 2", "2}}", "no trial is a success"),
        ("design:", TRACK % "up_down: {reversals: 30}, rounds: 20", "30}, rounds", "there are 20 rounds"),
        ("design:", TRACK % "up_down: {}, rounds: 5", "5}}", "there are 5 rounds"),
        ("design:", "streams: {a: {type: EEG, evening: forbid, min_delay_s: 0.01}}\ndesign:", "0.01}", "or do not write evening: forbid"),
        ("design:", "streams: {a: {type: EEG, stamped: at_sampling, min_delay_s: 0.01}}\ndesign:", "at_sampling", "keeps timestamps as they are"),
    ],
)  # fmt: skip
def test_what_is_wrong_of_several_keys_is_told_at_one_of_them(
    told, old: str, new: str, at: str, said: str
) -> None:
    text = AIMING.replace(old, new, 1)
    found = [line for line in told("aiming", text) if said in line]
    assert len(found) == 1, found
    assert found[0].startswith(column_of(text, at)), found


@pytest.mark.parametrize(
    ("joints", "more", "at"),
    [
        ("{slew: joint1, shoulder: joint2, elbow: joint3, wrist: joint4}", ", speeds_deg_s: {elbow: 900}", "900"),
        ("{slew: joint1, shoulder: joint2, elbow: joint3, wrist: joint4}", "", "joint3"),
    ],
)  # fmt: skip
def test_a_question_of_a_described_machine_is_asked_where_the_joint_is(
    told, tmp_path: Path, registry: Registry, joints: str, more: str, at: str
) -> None:
    machine = f"machine: {{urdf: openmanipulator_x.urdf, joints: {joints}, tip: gripper{more}}}"
    text = AIMING.replace("machine: ch8", machine).replace("[2, 3, 4, 6], width: 0.5", NEAR)
    text = text.replace("mujoco_crane, actuator: ideal", "kinematic_crane")
    told("aiming", text)
    folder = tmp_path / "aiming"
    robot = (PROTOCOLS.parent / "examples" / "machines" / "openmanipulator_x.urdf").read_text()
    joint = robot.index('name="joint3"')
    fast = robot[:joint] + re.sub(r'velocity="[^"]*"', 'velocity="20"', robot[joint:], count=1)
    (folder / "openmanipulator_x.urdf").write_text(fast, encoding="utf-8")
    study = load(folder / "protocol.yaml", registry)
    asked = [each for each in questions(study) if "degrees in a second" in each.text]
    found = [f"{study.where(each.place).removeprefix(f'{study.path}:')}: " for each in asked]
    assert found == [column_of(text, at)]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("limit_s: 30", "limit_s: -1", "tasks.aiming.limit_s is -1; it must be greater than 0 s"),
        ("width: 0.5", "width: -1 cm", "tasks.aiming.width is -0.01; it must be greater than 0 m"),
        ("dead_zone: 0.05", "dead_zone: 5 %", "scheme.dead_zone is '5 %'; it must be a number; write 0.05 for 5 %"),
        ("dead_zone: 0.05", "dead_zone: 5", "scheme.dead_zone is 5; it must be less than 1"),
        ("design:", TRACK % "up_down: {harder_afters: 1}", "'harder_afters' is not a key of design.tracks.t.up_down; did you mean 'harder_after'?"),
        ("design:", TRACK % "up_down: {}, foo: 1", "'foo' is not a key of design.tracks.t; possible: factor, levels, up_down, quest_plus, start, rounds, measure, at_least, at_most, carry"),
        ("design:", "monitors: {a: {use: stick_signal, foo: 1}}\ndesign:", "'foo' is not a key of monitors.a, which has no keys; remove it"),
    ],
)  # fmt: skip
def test_a_number_that_cannot_be_is_told_with_its_bound_and_unit(
    told, old: str, new: str, said: str
) -> None:
    assert old in AIMING
    (line,) = told("aiming", AIMING.replace(old, new, 1))
    assert line.split(": ", 1)[1] == said


@pytest.mark.parametrize("most", ["-1", "0"])
def test_no_time_is_below_nothing(told, most: str) -> None:
    track = TRACK % f"up_down: {{}}, measure: movement_time, at_most: {most}"
    text = AIMING.replace("design:", track, 1).replace("block: {task", "block: {track: t, task")
    (line,) = told("aiming", text)
    assert line.startswith(column_of(text, f"{most}}}}}"))
    assert line.endswith("so that no trial is a success; it must be greater than 0 s")


@pytest.mark.parametrize(
    ("sees", "said"),
    [
        ("window", "view 'window' has no patch for a photodiode; write patch: {} under it"),
        ("widow", "there is no view or feedback 'widow'; did you mean 'window'? there is window"),
    ],
)
def test_a_sensor_is_at_a_view_with_a_patch(
    sees: str, said: str, tmp_path: Path, registry: Registry
) -> None:
    path = tmp_path / "protocol.yaml"
    seen = f"streams:\n  eeg: {{name: Amplifier, sees: {{Diode: {sees}}}}}\n"
    path.write_text(f"{SHORT}views:\n  window: {{use: view}}\n{seen}", encoding="utf-8")
    with pytest.raises(ProtocolError) as told:
        load(path, registry)
    assert str(told.value).endswith(said)
