"""Panel, joysticks and keyboard: each drives the arm of the scenarios by its own protocol."""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import can
import pytest
from cranes import needs_bullet
from faults.sessions import wait_for
from plugins.test_keyboard import keys_outlet
from rehearsal import loaded
from ruamel.yaml import YAML
from virtual_sticks import desk

from labcrane import Tick
from labcrane.protocol.rig import Rig
from labcrane.testing import Study, main, make_frame
from labcrane_can.avc import encode

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
JOINTS = ("base", "arm", "boom", "jaws")
OWN = {"study", "title", "input", "operator", "scheme", "expected"}
"""What a variant may say otherwise; and its view's keys."""


class Controls(NamedTuple):
    """What somebody at the controls can do.

    Attributes
    ----------
    study
        With these controls.
    push
        Moves one joint's control all the way, towards 1 or -1; 0 lets it go.
    wait_s
        How long what is done takes to arrive.
    """

    study: Study
    push: Callable[[str, int], None]
    wait_s: float


def written(name: str) -> dict:
    return YAML(typ="safe").load((RETRIEVAL / name).read_text())


@pytest.mark.parametrize("name", ["joysticks.yaml", "keyboard.yaml"])
def test_a_variant_is_the_study_but_for_the_controls(name: str) -> None:
    variant, study = written(name), written("protocol.yaml")
    variant["views"]["operator"].pop("keys", None)
    for each in (variant, study):  # the button with which a deformity is reported
        assert each["tasks"]["retrieval"].pop("find_axis")
    differ = {key for key in {*variant, *study} if variant.get(key) != study.get(key)}
    assert differ <= OWN, f"write the same {', '.join(sorted(differ - OWN))} into {name}"


@contextmanager
def panel(study: Study) -> Iterator[Controls]:
    """A panel on a bus of this process, which repeats its commands as panels do."""
    choice = study.input
    settings = choice.settings.model_copy(update={"bus": "virtual:retrieval"})
    object.__setattr__(choice, "settings", settings)
    held = dict.fromkeys(JOINTS, 0)
    with can.Bus(interface="virtual", channel="retrieval") as bus:

        def push(joint: str, way: int) -> None:
            held[joint] = way
            for valve, name in enumerate(JOINTS, start=1):
                identifier, data = encode(valve, 250 * held[name], 0x25)
                bus.send(can.Message(arbitration_id=identifier, data=data))

        yield Controls(study, push, 0.05)


STICKS = {"base": (0, 0, -1), "arm": (0, 1, -1), "boom": (1, 1, -1), "jaws": (1, 0, 1)}
"""Of each joint: which stick, which of its axes, and which way is 1."""


@contextmanager
def joysticks(study: Study) -> Iterator[Controls]:
    with desk() as table:
        plugged = [table.plug(), table.plug()]

        def push(joint: str, way: int) -> None:
            stick, axis, sign = STICKS[joint]
            plugged[stick].move(axis, 32767 * sign * way)

        yield Controls(study, push, 0.0)


@contextmanager
def keyboard(study: Study) -> Iterator[Controls]:
    keys = written("keyboard.yaml")["views"]["operator"]["keys"]
    axes = written("keyboard.yaml")["input"]["axes"]
    view, outlet = keys_outlet(keys)
    settings = study.input.settings.model_copy(update={"view": view})
    object.__setattr__(study.input, "settings", settings)

    def hold(*down: str) -> None:
        outlet.push_sample([0.0, *(float(key in down) for key in keys)])

    def push(joint: str, way: int) -> None:
        hold(*[axes[joint][(1 + way) // 2]] * (way != 0))

    yield Controls(study, push, 0.05)


EACH = pytest.mark.parametrize(
    "controls", [panel, joysticks, keyboard], ids=lambda each: each.__name__
)


@pytest.mark.slow
@needs_bullet
@EACH
def test_each_control_moves_each_joint_both_ways_and_stops_it(controls) -> None:
    name = "protocol" if controls is panel else controls.__name__
    study = loaded(RETRIEVAL / f"{name}.yaml")
    with controls(study) as (changed, push, wait_s):
        rig = Rig.build(changed, simulated=False)
        with rig.opened(changed, 1) as run:
            state = rig.dynamics.state()
            angles, number = run.state.find("joint.angle"), 0

            def drive(seconds: float, joint: str, way: int) -> None:
                nonlocal state, number
                for _ in range(round(seconds * run.rate_hz)):
                    if number % 12 == 0 and wait_s:
                        push(joint, way)  # panels and views say again what is held
                        time.sleep(wait_s / 10.0)
                    number += 1
                    now = time.perf_counter()
                    frame = make_frame(run, number, state)
                    axes = rig.input.read(Tick(number, now, now), frame)
                    state = rig.dynamics.step(rig.controller.command(axes, state), 1 / run.rate_hz)

            def moved(joint: str, way: int) -> float:
                before = float(state[angles][JOINTS.index(joint)])
                push(joint, way)
                drive(1.0, joint, way)
                after = float(state[angles][JOINTS.index(joint)])
                push(joint, 0)
                drive(1.5, joint, 0)  # a valve shuts with its dead time and lag
                return after - before

            def there() -> bool:
                push("base", 0)
                now = time.perf_counter()
                rig.input.read(Tick(1, now, now), make_frame(run, 1, state))
                return rig.input.fault is None

            wait_for(there)
            for joint in JOINTS:
                for way in (1, -1):
                    assert way * moved(joint, way) > 0.03, (joint, way)
                still = float(state[angles][JOINTS.index(joint)])
                drive(0.5, joint, 0)
                assert float(state[angles][JOINTS.index(joint)]) == pytest.approx(still, abs=1e-3)


@pytest.mark.long
@needs_bullet
@pytest.mark.parametrize("turned", ["", "-"])
@pytest.mark.parametrize("name", ["joysticks.yaml", "keyboard.yaml"])
def test_whichever_controls_there_are_the_study_can_be_rehearsed(
    name: str, turned: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(RETRIEVAL, tmp_path / "study")
    path = tmp_path / "study" / name
    text = path.read_text(encoding="utf-8")
    axis = {"joysticks.yaml": "jaws: right.x", "keyboard.yaml": "jaws: keyboard.jaws"}[name]
    assert text.count(axis) == 2  # in the scheme, and of the operator who stands in
    path.write_text(text.replace(axis, axis.replace(": ", f": {turned}")), encoding="utf-8")
    assert main(["check", str(path), "--rehearse"]) == 0
    said = capsys.readouterr()
    assert said.err == ""  # no scene ran out of time, which would be asked about
    assert said.out.endswith("and was rehearsed\n")
