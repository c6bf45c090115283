"""A machine turns the way the stick says, in the operator's own picture.

ISO 10968 and the ISO pattern of excavators (SAE J1177): the left stick to the right turns
right, pulling it draws the arm in; pulling the right stick lifts the boom, to the left curls the
bucket in.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet, needs_mujoco

from labcrane.protocol.rig import Rig
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
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
    study = load(study_path, discover())
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


@needs_bullet
def test_the_arm_of_the_scenarios_turns_the_way_the_stick_says() -> None:
    path = ROOT / "protocols" / "retrieval" / "joysticks.yaml"
    for way in (1.0, -1.0):
        before, after = moved(path, left_x=way)
        assert way * (before[1] - after[1]) > 0.02, "y is to the left of who looks along x"
