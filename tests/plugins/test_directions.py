"""A machine turns the way the stick says, in the operator's own picture.

ISO 10968 and the ISO pattern of excavators (SAE J1177): the left stick to the right turns
right, pulling it draws the arm in; pulling the right stick lifts the boom, to the left curls the
bucket in.
"""

import re
from pathlib import Path
from random import Random
from shutil import copytree

import numpy as np
import pytest
from cranes import needs_mujoco
from rehearsal import loaded
from scheme_setups import LOW, MACHINES, STICKS, end_effector, joint_velocity, push, ready

from labcrane import Signal
from labcrane.doctor.checks import directions
from labcrane.machines import jacobian
from labcrane.protocol.questions import questions
from labcrane.protocol.rig import Rig
from labcrane.testing import make_run
from labcrane_dmd.arm.settings import ValveSettings
from labcrane_dmd.arm.valve import Valve
from labcrane_schemes.end_effector import EndEffector
from labcrane_schemes.joint_velocity import JointVelocity
from labcrane_view.areas import Projection
from labcrane_view.settings import CAMERAS

ROOT = Path(__file__).parents[2]
WRITTEN = re.compile(r"map: \{(\w+: -?(?:left|right)\.[xy][^}]*)\}")
LOOK = np.array([5.2, 0.3, 0.8])


def maps() -> dict[str, set[tuple[str, ...]]]:
    """Every map from two sticks to joints that is shipped, by the file that has it."""
    found = {}
    for folder in ("labcrane", "plugins", "protocols", "examples", "docs"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix not in {".yaml", ".md"} or "decisions" in path.parts:
                continue
            here = {tuple(text.split(", ")) for text in WRITTEN.findall(path.read_text("utf-8"))}
            if here:
                found[str(path.relative_to(ROOT))] = here
    return found


def test_every_map_that_is_shipped_has_the_same_directions() -> None:
    found = maps()
    assert len(found) >= 10
    for path, here in found.items():
        for text in here:
            written = dict(part.split(": ") for part in text)
            if set(written) <= set(RIGHT):  # joints; others name directions of the tip
                assert written == {joint: RIGHT[joint] for joint in written}, path


RIGHT = {
    "slew": "-left.x", "base": "-left.x", "elbow": "left.y", "arm": "-left.y",
    "wrist": "-right.x", "jaws": "right.x", "shoulder": "-right.y", "boom": "-right.y",
}  # fmt: skip
"""Which way of which stick moves a joint to positive angles."""

KEYS = {
    "-left.x": "a", "left.x": "d", "-left.y": "w", "left.y": "s",
    "-right.x": "j", "right.x": "l", "-right.y": "i", "right.y": "k",
}  # fmt: skip
"""Keys that are two sticks, seen from behind them; y is positive when a stick is pulled."""

AXES = re.compile(r"axes: \{(\w+: \[\w, \w\][^}]*)\}")


def test_keys_of_a_keyboard_have_the_directions_of_two_sticks() -> None:
    found = [
        (path, text)
        for folder in ("protocols", "docs")
        for path in sorted((ROOT / folder).rglob("*"))
        if path.suffix in {".yaml", ".md"}
        for text in AXES.findall(path.read_text("utf-8"))
    ]
    assert len(found) >= 3
    for path, text in found:
        keys = re.findall(r"(\w+): \[(\w), (\w)\]", text)
        for joint, lower, higher in keys:
            if joint in RIGHT:
                stick = RIGHT[joint]
                other = stick[1:] if stick[0] == "-" else f"-{stick}"
                assert (lower, higher) == (KEYS[other], KEYS[stick]), (path, joint)


def moved(study_path: Path, **axes: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where the tip is before and after a push of half a second, in m."""
    study = loaded(study_path)
    rig = Rig.build(study, simulated=False)
    run = rig.describe(study, 1)
    rig.dynamics.open(run)
    rig.controller.open(run)
    try:
        state = rig.dynamics.state()
        tip = run.state.find("tip.position")
        before, pushed = state[tip].copy(), np.zeros(run.axes.size)
        for name, value in axes.items():
            pushed[run.axes.columns.index(name.replace("_", "."))] = value
        for _ in range(round(0.5 * run.rate_hz)):
            command = rig.controller.command(pushed, state)
            state = rig.dynamics.step(command, 1.0 / run.rate_hz)
        return before, state[tip].copy()
    finally:
        rig.controller.close()
        rig.dynamics.close()


def seen(point: np.ndarray) -> tuple[float, float]:
    """Return where a point is in the picture from the cab, in pixels, y down."""
    picture = Projection(np.array(CAMERAS["cab"].eye), LOOK, 80.0, 0, 1280, 720)
    left, top, right, bottom = picture.ball(point, 0.01)
    return (left + right) / 2.0, (top + bottom) / 2.0


@needs_mujoco
@pytest.mark.parametrize("study", ["aiming/protocol.yaml", "crane_pilot/protocol.yaml"])
def test_the_tip_goes_where_the_stick_points(study: str) -> None:
    path = ROOT / "protocols" / study
    for way in (1.0, -1.0):
        before, after = moved(path, left_x=way)
        assert way * (seen(after)[0] - seen(before)[0]) > 10.0, "right is right"
        before, after = moved(path, right_y=way)  # towards the operator
        assert way * (after[2] - before[2]) > 0.05, "a pull lifts"
        before, after = moved(path, left_y=way)
        assert way * (np.linalg.norm(before[:2]) - np.linalg.norm(after[:2])) > 0.02, "draws in"


MOVES = {
    "turns to the left": (1, 1.0), "turns to the right": (1, -1.0),
    "goes to the left": (1, 1.0), "goes to the right": (1, -1.0),
    "goes away from you": (0, 1.0), "goes towards you": (0, -1.0),
    "goes up": (2, 1.0), "goes down": (2, -1.0),
    "moves the tip up from rest": (2, 1.0), "moves the tip down from rest": (2, -1.0),
    "moves the tip away from you from rest": (0, 1.0),
    "moves the tip towards you from rest": (0, -1.0),
}  # fmt: skip
"""Along which axis of the base frame the tip goes, and which way, of an arm straight ahead."""

PUSHES = {
    "left stick to the right": "left_x", "right stick to the right": "right_x",
    "left stick towards you": "left_y", "right stick towards you": "right_y",
}  # fmt: skip


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("seed", range(12))
def test_the_machine_goes_where_the_words_of_its_map_say(name: str, seed: int) -> None:
    machine, dice = MACHINES[name], Random(seed)
    axes = [f"{dice.choice('-+')}{axis}".lstrip("+") for axis in STICKS if "trigger" not in axis]
    dice.shuffle(axes)
    frame = dice.choice(["base", "arm"])
    ways = ("x", "y", "z") if frame == "base" else ("radial", "tangential", "vertical")
    joints = joint_velocity(map=dict(zip(machine.names, axes, strict=True)))
    tip = end_effector(frame=frame, map=dict(zip(ways, axes, strict=False)))
    for settings, controller in ((joints, JointVelocity), (tip, EndEffector)):
        said = settings.directions(machine)
        assert len(said) == len(settings.map)
        scheme = ready(controller(settings, machine), machine)
        for sentence, moved in zip(said, settings.map, strict=True):
            pushed, goes = sentence.split(": ")
            along, sign = MOVES[goes.removeprefix(f"the {moved} ").removeprefix("the tip ")]
            state = np.array(machine.rest) if controller is JointVelocity else LOW[name]
            speeds = scheme.command(push(**{PUSHES[pushed]: 0.8}), state)[: len(machine.names)]
            velocity = jacobian(machine, state) @ speeds
            assert sign * velocity[along] > 0.01, sentence
            if "moves" in goes:
                assert abs(velocity[along]) == max(abs(velocity)), "it goes no other way by more"


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("seed", range(4))
def test_the_machine_goes_where_the_words_of_its_valves_say(name: str, seed: int) -> None:
    """A valve that extends lowered the boom by 2.31 m, and nothing asked about it."""
    machine, dice = MACHINES[name], Random(seed)
    turned = {joint: f"-valve.{joint}" for joint in machine.names if dice.random() < 0.5}
    settings = ValveSettings(map=turned)
    scheme = Valve(settings, machine)
    run = make_run(machine, axes=[Signal("valve", "1", machine.names)])
    scheme.open(run)
    for sentence, joint in zip(settings.directions(machine), machine.names, strict=True):
        given, goes = sentence.split(": ")
        assert given == f"valve.{joint} extends"
        along, sign = MOVES[goes.removeprefix(f"the {joint} ")]
        pushed = np.zeros(run.axes.size)
        pushed[run.axes.index(f"valve.{joint}")] = 0.8
        speeds = scheme.command(pushed, np.array(machine.rest))[: len(machine.names)]
        assert sign * (jacobian(machine, machine.rest) @ speeds)[along] > 0.01, sentence
    first = machine.joints[1].name
    assert ("map" in settings.doubts(machine)) == (first not in turned)


MAP = (
    "use: joint_velocity\n"
    "  map: {slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}"
)
TIP = "use: end_effector\n  map: {x: -left.y, y: -left.x, z: right.y}"
ARM = (
    "use: end_effector\n  frame: arm\n"
    "  map: {radial: -left.y, tangential: -left.x, vertical: right.y}"
)
BOTH = (
    "use: switchable\n  button: left.trigger\n  joint_velocity: {map: {slew: -left.x, "
    "elbow: left.y, wrist: -right.x, shoulder: -right.y}}\n"
    "  end_effector: {map: {x: -left.y, y: -left.x, z: right.y}}"
)
ROUND = {
    "slew: -left.x": "turns to the left when the left stick is moved to the right",
    "wrist: -right.x": "wrist moves the tip towards you from rest when the right stick is moved to "
    "the right",
    "shoulder: -right.y": "shoulder moves the tip down from rest when the right stick is moved "
    "towards you",
    " y: -left.x": "tip goes to the left when the left stick is moved to the right",
    "tangential: -left.x": "tip goes to the left when the left stick is moved to the right",
    "{x: -left.y": "tip goes away from you when the left stick is moved towards you",
    "radial: -left.y": "tip goes away from you when the left stick is moved towards you",
}
"""What is turned round by a minus that is left out."""


def a_study(folder: Path, scheme: str, more: str = "") -> Path:
    copytree(ROOT / "protocols" / "aiming", folder / "aiming", dirs_exist_ok=True)
    path = folder / "aiming" / "protocol.yaml"
    text = (ROOT / "protocols" / "aiming" / "protocol.yaml").read_text("utf-8")
    written = f"{MAP}\n  dead_zone: 0.05\n  expo: 0.2"
    assert written in text
    path.write_text(text.replace(written, scheme).replace("rate_hz:", f"{more}rate_hz:"), "utf-8")
    return path


def asked_of(path: Path) -> dict[str, str]:
    """Return what a check asks of the scheme's map."""
    found = questions(loaded(path))
    return {each.key: each.text for each in found if ".map." in each.key}


@pytest.mark.parametrize("scheme", [MAP, TIP, ARM, BOTH], ids=["joints", "tip", "arm", "both"])
def test_a_stick_that_moves_the_machine_the_other_way_is_asked_about(
    tmp_path: Path, scheme: str
) -> None:
    assert asked_of(a_study(tmp_path, scheme)) == {}
    written = [each for each in ROUND if each in scheme]
    assert len(written) >= 2
    for each in written:
        turned = a_study(tmp_path, scheme.replace(each, each.replace("-", "")))
        ((key, text),) = asked_of(turned).items()
        moved = each.strip(" {").split(":")[0]
        assert key.endswith(f"map.{moved}")
        assert ROUND[each] in text
        answered = a_study(
            tmp_path, scheme.replace(each, each.replace("-", "")), f"expected: [{key}]\n"
        )
        assert asked_of(answered) == {}


def test_a_push_that_would_lift_the_tip_is_asked_about(tmp_path: Path) -> None:
    path = a_study(tmp_path, TIP.replace("z: right.y", "z: -right.y"))
    assert asked_of(path) == {
        "scheme.map.z": "scheme.map.z is -right.y, so that the tip goes down when the right stick "
        "is moved towards you; with right.y it is the other way round; is that meant?"
    }


def test_a_gripper_and_axes_of_no_stick_have_no_usual_direction() -> None:
    study = loaded(ROOT / "protocols" / "retrieval" / "joysticks.yaml")
    settings = study.scheme.settings
    assert "map.jaws" not in settings.doubts(study.machine)
    assert not any("jaws moves" in said for said in settings.directions(study.machine))
    levers = joint_velocity(map={name: name for name in MACHINES["ch8"].names})
    assert levers.doubts(MACHINES["ch8"]) == {}
    assert levers.directions(MACHINES["ch8"])[1] == (
        "shoulder forward: the shoulder moves the tip down from rest"
    )


def test_the_doctor_says_which_way_the_machine_of_a_study_goes() -> None:
    study = loaded(ROOT / "protocols" / "aiming" / "protocol.yaml")
    said = [finding.text for finding in directions(study)]
    assert said == [
        "left stick to the right: the slew turns to the right",
        "left stick towards you: the elbow moves the tip down from rest",
        "right stick to the right: the wrist moves the tip away from you from rest",
        "right stick towards you: the shoulder moves the tip up from rest",
    ]
