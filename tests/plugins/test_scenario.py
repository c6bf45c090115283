"""Scenes judged: what is counted, what is found, what ends a run."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from labcrane import InputDevice, ProtocolError, Run, Signal, Task
from labcrane.core import Event, Phase, PlannedTrial
from labcrane.machines import load_part, load_scene, place_objects, read_surface
from labcrane.testing import (
    InputContract,
    TaskContract,
    ch8,
    crane_state,
    make_frame,
    make_run,
    make_trial,
)
from labcrane_scenario.mistakes import ContactEpisode
from labcrane_scenario.operator import ScenarioOperator
from labcrane_scenario.scenario import Scenario
from labcrane_scenario.settings import PanelOperatorSettings, ScenarioSettings

RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
OVERLOAD = Signal("joint.overload", "1", ch8().names)
FREE = """\
labcrane_scene: 1
title: nothing but a goal
goals: [{position: [30, 0, 0], radius: 0.1}]
limit_s: 60
"""


class TestScenario(TaskContract):  # "scenario"
    needs = (OVERLOAD,)

    @pytest.fixture
    def task(self, tmp_path: Path) -> Task:
        (tmp_path / "free.yaml").write_text(FREE, encoding="utf-8")
        return Scenario(ScenarioSettings(scenes=(tmp_path / "free.yaml",)), ch8())


class TestScenarioOperator(InputContract):  # "scenario_operator"
    @pytest.fixture
    def device(self) -> InputDevice:
        return ScenarioOperator(PanelOperatorSettings(jaws="wrist"), ch8())


def test_a_force_that_trembles_around_its_limit_is_one_mistake() -> None:
    episode = ContactEpisode(100.0, 0.8, hold=48)
    began = [episode.see(force) for force in [50, 101, 99, 120, 70, 110] * 50 + [10] * 60 + [101]]
    assert sum(began) == 2
    assert episode.peak == 120


BLOCK = """\
labcrane_scene: 1
title: a block to push
things:
  block: {shape: box, size: [0.3, 0.3, 0.2], position: [1.6, 0, 0.1], mass_kg: 20, limit_n: 100}
goals: [{position: [30, 0, 0], radius: 0.1}]
limit_s: 60
"""
FORCE = "scene.block.force.block"


def at_the_block(text: str, folder: Path, **settings: int) -> tuple[Run, Scenario]:
    """Return a run in a scene with the block, and its task in its first trial."""
    (folder / "block.yaml").write_text(text, encoding="utf-8")
    task = Scenario(ScenarioSettings(scenes=(folder / "block.yaml",), **settings), ch8())
    state = (
        *crane_state(ch8()).signals,
        OVERLOAD,
        Signal("scene.block.position", "m", ("x", "y", "z")),
        Signal("scene.block.force", "N", ("block",)),
        Signal("scene.block.support", "N"),
    )
    run = make_run(ch8(), state=state, task=task.signals)
    task.open(run)
    task.begin_trial(make_trial(PlannedTrial({"scenario": "block"}, expected_s=1.0)))
    return run, task


def judged(tmp_path: Path, pushes: list[float], *, lift_limits: bool = False):
    """Return the task's judgements of a force on the block, tick by tick."""
    run, task = at_the_block(BLOCK, tmp_path, mistakes=4)
    if lift_limits:
        task.lift_limits()
    seen = []
    for number, force in enumerate(pushes):
        values = np.zeros(run.state.size)
        values[run.state.index(FORCE)] = force
        values[run.state.index("scene.block.support")] = 20 * 9.81
        seen.append(task.evaluate(make_frame(run, number, values)))
        if seen[-1].phase.over:
            break
    return seen


PUSH = [150.0] * 30 + [0.0] * 60


def test_five_mistakes_of_a_kind_end_the_run_and_four_do_not(tmp_path: Path) -> None:
    assert not judged(tmp_path, PUSH * 4)[-1].phase.over
    seen = judged(tmp_path, PUSH * 6)
    assert seen[-1].phase is Phase.FAILURE
    events = [event for judgement in seen for event in judgement.events]
    counts = [event.data["count"] for event in events if event.name == "contact.object"]
    assert counts == [1, 2, 3, 4, 5]
    assert events[-1].name == "mistakes.too_many"
    assert seen[-1].results["k"] == 0.0
    assert seen[-1].results["n_object"] == 5.0
    assert seen[-1].results["peak_force.object"] == 150.0


def test_an_overridden_run_outlasts_its_mistakes(tmp_path: Path) -> None:
    seen = judged(tmp_path, PUSH * 8, lift_limits=True)
    assert not seen[-1].phase.over
    assert seen[-1].values[-5] == 8.0


def test_the_same_seed_places_everything_the_same_and_another_one_does_not() -> None:
    scene = load_scene(RETRIEVAL / "scenes" / "casualty.yaml")
    assert place_objects(scene, 4) == place_objects(scene, 4)
    found = {place_objects(scene, seed)[-1].deformed for seed in range(20)}
    assert found == {"left_forearm", "left_shank", "right_shank", None}
    yaws = [place_objects(scene, seed)[-1].yaw for seed in range(50)]
    assert math.radians(162) <= min(yaws) < max(yaws) <= math.radians(170)


def test_in_the_stated_share_of_trials_nobody_is_deformed_and_all_else_is_the_same() -> None:
    scene = load_scene(RETRIEVAL / "scenes" / "casualty.yaml")
    assert scene.figure is not None
    assert scene.figure.deformity is not None
    share, seeds = scene.figure.deformity.absent, range(1000)
    none = [place_objects(scene, seed)[-1].deformed is None for seed in seeds]
    assert abs(sum(none) - 1000 * share) < 4.0 * math.sqrt(1000 * share * (1.0 - share))
    always = scene.figure.deformity.model_copy(update={"absent": 0.0})
    figure = scene.figure.model_copy(update={"deformity": always})
    other = scene.model_copy(update={"figure": figure})
    for seed in seeds[:50]:
        with_one, maybe = place_objects(other, seed)[-1], place_objects(scene, seed)[-1]
        assert with_one.deformed is not None
        assert maybe.yaw == with_one.yaw
        straight = {part.name for part in maybe.parts} - {with_one.deformed}
        for name in straight - {"left_forearm", "left_shank", "right_shank"}:
            assert [part for part in maybe.parts if part.name == name] == [
                part for part in with_one.parts if part.name == name
            ]
        assert (maybe.parts == with_one.parts) == (maybe.deformed is not None)


def test_things_are_placed_while_a_session_runs_without_a_file_being_read(tmp_path: Path) -> None:
    shutil.copytree(RETRIEVAL / "scenes", tmp_path / "scenes")
    scenes = {path: load_scene(path) for path in (tmp_path / "scenes").glob("*.yaml")}
    before = {path: place_objects(scene, 1) for path, scene in scenes.items()}
    shutil.rmtree(tmp_path / "scenes")
    assert {path: place_objects(scene, 1) for path, scene in scenes.items()} == before
    assert len(before) == 6


def test_a_part_that_is_drawn_by_a_mesh_is_touched_where_it_is_seen() -> None:
    (stone,) = load_part(RETRIEVAL / "scenes" / "parts" / "boulder.yaml").shapes.values()
    assert stone.mesh is not None
    touched = ConvexHull(np.array(stone.points))
    surface = read_surface(stone.mesh.file)
    corners = surface.points[surface.faces]
    beyond = corners.reshape(-1, 3) @ touched.equations[:, :3].T + touched.equations[:, 3]
    assert beyond.max() < 1e-6
    # A closed surface that turns outwards has this volume (divergence theorem).
    volume = float(np.linalg.det(corners).sum() / 6.0)
    assert volume == pytest.approx(touched.volume, rel=1e-5)
    assert 0.1 < volume < 0.2


def test_a_goal_of_which_the_state_says_nothing_is_refused_before_the_session(
    tmp_path: Path,
) -> None:
    text = (RETRIEVAL / "scenes" / "casualty.yaml").read_text(encoding="utf-8")
    goal = "  - {what: figure.pelvis, position: [1.1, 0.4, 0.3], radius: 0.3}\n"
    shutil.copytree(RETRIEVAL / "scenes" / "parts", tmp_path / "parts")
    (tmp_path / "lying.yaml").write_text(text.replace("goals:\n", f"goals:\n{goal}"), "utf-8")
    task = Scenario(ScenarioSettings(scenes=(tmp_path / "lying.yaml",)), ch8())
    run = make_run(ch8(), state=crane_state(ch8()).signals, task=task.signals)
    said = r"scene 'lying': a goal names 'figure.pelvis', whose position is not in the machine's"
    with pytest.raises(ProtocolError, match=said):
        task.open(run)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("0.1], mass", "0.02], mass"), r"block.yaml:4:\d+: 'block' is 0.080 m deep in the ground"),
        (
            ("radius: 0.1}", "radius: 0.1, what: blok}"),
            r"block.yaml:5:\d+: there is no 'blok' in this",
        ),
        (
            ("radius: 0.1}", "radius: 0.1, touch: blok}"),
            r"block.yaml:5:\d+: there is no 'blok' in this",
        ),
        (
            ("goals:", "figure: {position: [1, 0, 0.01]}\ngoals:"),
            r"the figure's chest is 0.01 m high, which is in the ground; 0.11 m or more",
        ),
        (
            ("goals:", "figure: {position: [1, 0, 0.2], limbs_deg: {tail: 3}}\ngoals:"),
            r"a figure has no 'tail'; it has left_upper_arm",
        ),
    ],
)
def test_impossible_scenes_are_refused_with_their_line(
    change: tuple[str, str], message: str, tmp_path: Path
) -> None:
    path = tmp_path / "block.yaml"
    path.write_text(BLOCK.replace(*change), encoding="utf-8")
    with pytest.raises(ProtocolError, match=message):
        load_scene(path)


TOUCH = BLOCK.replace(
    "[30, 0, 0], radius: 0.1}", "[1.6, 0, 0.1], radius: 0.5, touch: block, hold_s: 0.2}"
)


def touching(folder: Path, forces: list[float], *, away: float = 0.0) -> tuple[list[float], int]:
    """Return ``target.touch`` tick by tick, and in which the goal was reached; -1 in none."""
    run, task = at_the_block(TOUCH, folder)
    touched: list[float] = []
    for number, force in enumerate(forces):
        values = np.zeros(run.state.size)
        values[run.state.find("tip.position")] = (1.3 - away, 0.0, 0.2)
        values[run.state.index(FORCE)] = force
        judged = task.evaluate(make_frame(run, number, values))
        touched.append(float(judged.values[run.task.index("target.touch")]))
        if judged.phase is Phase.SUCCESS:
            return touched, number
    return touched, -1


@pytest.mark.parametrize(
    ("forces", "away", "reached"),
    [
        ([0.0] * 300, 0.0, -1),  # as near as can be, and not touched
        ([0.0] * 10 + [40.0] * 100, 0.0, 58),  # 0.2 s at 240 Hz after the tick that touched
        ([0.0] * 10 + [40.0] * 5 + [0.0] * 95, 0.0, 58),  # a thing that gives way is touched too
        ([40.0] * 20 + [101.0] * 100, 0.0, -1),  # beyond its limit of 100 N
        ([40.0] * 20 + [101.0] * 10 + [0.0] * 100, 0.0, -1),  # and not touched again
        ([40.0] * 20 + [101.0] * 10 + [0.0] * 20 + [9.0] * 100, 0.0, 98),
        ([40.0] * 300, 1.0, -1),  # by something else: the tip is not there
    ],
)
def test_a_thing_is_touched_by_a_force_on_it_that_stays_below_its_limit(
    forces: list[float], away: float, reached: int, tmp_path: Path
) -> None:
    touched, found = touching(tmp_path, forces, away=away)
    assert found == reached
    assert set(touched) <= {0.0, 1.0}
    if not away:  # once it is reached, there is no next goal: nothing is touched any more
        gentle = [force for force, one in zip(forces, touched, strict=False) if one == 1.0]
        assert all(force <= 100.0 for force in gentle)


def test_a_thing_of_which_no_force_is_known_cannot_be_touched(tmp_path: Path) -> None:
    (tmp_path / "block.yaml").write_text(TOUCH, encoding="utf-8")
    task = Scenario(ScenarioSettings(scenes=(tmp_path / "block.yaml",)), ch8())
    place = Signal("scene.block.position", "m", ("x", "y", "z"))
    state = (*crane_state(ch8()).signals, place)
    run = make_run(ch8(), state=state, task=task.signals)
    said = (
        r"scene 'block': 'block' is to be touched, and the machine's state has no force on it; it "
        r"has one on nothing. What is fixed has one where it has a limit_n"
    )
    with pytest.raises(ProtocolError, match=said):
        task.open(run)


LYING = """\
labcrane_scene: 1
title: somebody with a broken leg
figure:
  position: [1.6, 0, 0.2]
  deformity: {limbs: [left_shank]}
goals: [{position: [30, 0, 0], radius: 0.1}]
"""


def begun(text: str, folder: Path) -> tuple[Run, Scenario]:
    """Return a run in the scene of somebody who lies there, and its task in its first trial."""
    (folder / "lying.yaml").write_text(text, encoding="utf-8")
    settings = ScenarioSettings(scenes=(folder / "lying.yaml",), find_axis="button", limit_s=0.1)
    task = Scenario(settings, ch8())
    state = (
        *crane_state(ch8()).signals,
        OVERLOAD,
        Signal("scene.figure.position", "m", ("x", "y", "z")),
        Signal("scene.figure.orientation", "1", ("x", "y", "z", "w")),
    )
    run = make_run(ch8(), axes=(Signal("button", "1"),), state=state, task=task.signals)
    task.open(run)
    task.begin_trial(make_trial(PlannedTrial({"scenario": "lying"}, expected_s=1.0)))
    return run, task


@pytest.mark.parametrize(
    ("ahead", "turn", "button", "orders", "by"),
    [
        (1.2, 0.0, 1.0, {}, "operator"),  # the shank is about so far ahead of the chest
        (1.2, 90.0, 1.0, {}, None),  # and to the left of it once the body has been turned
        (-0.4, 0.0, 1.0, {}, None),  # at the head: nothing is found there
        (6.4, 0.0, 1.0, {}, None),  # pressed far away, without having seen anything
        (6.4, 0.0, 0.0, {3: ("note", "found: the left leg", "supervisor", None)}, "supervisor"),
        (1.2, 0.0, 0.0, {3: ("note", "the left leg", "supervisor", None)}, None),
        (1.2, 0.0, 0.0, {3: ("report", "deformity", "participant", None)}, "operator"),
        (6.4, 0.0, 0.0, {3: ("report", "deformity", "participant", None)}, None),
        (6.4, 0.0, 0.0, {3: ("report", "deformity", "supervisor", None)}, "supervisor"),
        (6.4, 0.0, 0.0, {3: ("report", "deformity", "terminal", None)}, "supervisor"),
        (1.2, 0.0, 0.0, {3: ("report", "fire", "participant", "asks for deformity")}, None),
    ],
)
def test_a_deformity_is_found_by_a_button_of_control_or_page_or_the_supervisors_note(
    ahead: float,
    turn: float,
    button: float,
    orders: dict[int, tuple[str, str, str, str | None]],
    by: str | None,
    tmp_path: Path,
) -> None:
    run, task = begun(LYING, tmp_path)
    events, results = [], {}
    for number in range(30):
        values = np.zeros(run.state.size)
        values[run.state.index("tip.position.x")] = 1.6 + ahead
        values[run.state.index("scene.figure.position.x")] = 1.6
        half = math.radians(turn) / 2.0
        values[run.state.find("scene.figure.orientation")] = (0, 0, math.sin(half), math.cos(half))
        frame = make_frame(run, number, values)
        frame.axes = np.array([button])
        if number in orders:
            order, text, page, refused = orders[number]
            data = {"text": text, "by": page, "refused": refused}
            frame.events = (Event(f"order.{order}", frame.tick.due, data),)
        judgement = task.evaluate(frame)
        events += [event for event in judgement.events if event.name == "deformity.found"]
        results = judgement.results or results
    assert [(event.data["by"], event.data["limb"]) for event in events] == (
        [(by, "left_shank")] if by else []
    )
    assert math.isnan(results["deformity_found"]) == (by is None)


NEAR_IT, FAR = 1.2, 6.4
"""Places ahead of the chest, in metres: at the shank, and far from everything."""


@pytest.mark.parametrize(
    ("there", "places", "worths", "columns"),
    [
        (True, {}, [], (1.0, 0.0, 0.0)),  # a miss
        (True, {5: NEAR_IT}, ["hit"], (1.0, 1.0, 0.0)),
        (True, {2: FAR, 5: NEAR_IT, 8: NEAR_IT}, ["far", "hit", "again"], (1.0, 1.0, 1.0)),
        (False, {}, [], (0.0, 0.0, 0.0)),  # a correct rejection
        (False, {3: NEAR_IT, 9: FAR}, ["none there", "none there"], (0.0, 0.0, 2.0)),
        (None, {3: NEAR_IT}, ["none there"], (math.nan, math.nan, 1.0)),
    ],
)
def test_every_report_is_an_event_and_its_worth_is_in_the_trial_table(
    there: bool | None,  # noqa: FBT001
    places: dict[int, float],
    worths: list[str],
    columns: tuple[float, float, float],
    tmp_path: Path,
) -> None:
    text = {
        True: LYING,
        False: LYING.replace("[left_shank]}", "[left_shank], absent: 1.0}"),
        None: LYING.replace("  deformity: {limbs: [left_shank]}\n", ""),
    }[there]
    run, task = begun(text, tmp_path)
    events, results = [], {}
    for number in range(30):
        values = np.zeros(run.state.size)
        # It is held down for two ticks each time: that is one report.
        pressed = [places[at] for at in (number, number - 1) if at in places]
        values[run.state.index("tip.position.x")] = 1.6 + (pressed[0] if pressed else FAR)
        values[run.state.index("scene.figure.position.x")] = 1.6
        values[run.state.index("scene.figure.orientation.w")] = 1.0
        frame = make_frame(run, number, values)
        frame.axes = np.array([float(bool(pressed))])
        judgement = task.evaluate(frame)
        events += [each for each in judgement.events if each.name == "deformity.reported"]
        results = judgement.results or results
        away = judgement.values[run.task.index("deformity.distance")]
        assert (away == -1.0) == (not there)
    assert [event.data["worth"] for event in events] == worths
    assert {event.data["by"] for event in events} <= {"operator"}
    found = tuple(results[name] for name in ("deformity", "found", "false_reports"))
    assert found == pytest.approx(columns, nan_ok=True)
