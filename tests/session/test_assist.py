"""Shared control: a blend of the operator's command and an assistant's, in whole sessions."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from needs import need
from rehearsal import Rehearsal, ScriptedConsole, a_study, rehearse
from simple_crane import CRANE

from labcrane import Controller, FloatArray, ProtocolError, Signal, Trial, open_recording
from labcrane.analysis.measures import measure_session
from labcrane.approval.codebook import codebook
from labcrane.core import Phase, PlannedTrial
from labcrane.protocol.assisted import Assisted
from labcrane.protocol.protocol import Assist
from labcrane.protocol.questions import questions
from labcrane.replay import replay_session
from labcrane.simulation.simulation import SimulationJob, simulate
from labcrane.testing import Visit, ch8, discover, load, make_run, plan_session, run
from labcrane_bids.events import event_description, event_table
from labcrane_bids.motion import tracking_systems

STUDY = (
    """\
labcrane: 1
study: assisted
title: Shared control
rate_hz: 60
"""
    + CRANE
    + """\
ASSIST
OPERATOR
tasks:
  aiming: {use: aiming, distances: [1, 2], movements: 2, limit_s: 20}
DESIGN
sessions:
  - name: only
    steps:
      - block: {task: aiming, pairs: 1}
"""
)
RETRIEVAL = Path(__file__).parents[2] / "protocols" / "retrieval"
IDLE = "operator: {use: simulated_operator, reaction_s: 1000, reaction_sd: 0}"


def text(assist: str = "", operator: str = "", design: str = "", **block: str) -> str:
    keys = "".join(f", {key}: {value}" for key, value in block.items())
    written = f"assist: {{use: toward_target, {assist}}}" if assist else ""
    made = STUDY.replace("ASSIST", written).replace("OPERATOR", operator).replace("DESIGN", design)
    return made.replace("pairs: 1}", f"pairs: 1{keys}}}")


def visit(folder: Path, written: str, **options) -> Visit:
    folder.mkdir(exist_ok=True)
    study = a_study(folder, written)
    return Visit(study, "P001", 1, folder / "data", simulated=True, fast=True, **options)


def signal(seen: Rehearsal, name: str) -> FloatArray:
    at = seen.run.command.find(name)
    return np.array([frame.command[at] for frame in seen.frames])


@pytest.mark.parametrize("share", ["0", "{none: 0}"])
def test_with_share_0_every_tick_is_that_of_the_study_without_an_assistant(
    share: str, tmp_path: Path
) -> None:
    alone = rehearse(a_study(tmp_path, text()))
    helped = rehearse(a_study(tmp_path, text(f"share: {share}")))
    assert len(alone.frames) == len(helped.frames) > 100
    assert np.abs(signal(helped, "assist.assistant")).max() > 0.1  # it asked for something else
    for one, other in zip(alone.frames, helped.frames, strict=True):
        assert one.state.tobytes() == other.state.tobytes()
        assert one.axes.tobytes() == other.axes[: len(one.axes)].tobytes()
        assert one.command.tobytes() == other.command[: len(one.command)].tobytes()
        assert one.task.tobytes() == other.task.tobytes()
        assert (one.phase, one.elapsed) == (other.phase, other.elapsed)


ARM = """machine: ied_arm.yaml
input: {use: dual_joystick}
scheme:
  use: valve
  map: {base: -left.x, arm: -left.y, boom: -right.y, jaws: right.x}
  model: arm.dmd.yaml
dynamics: {use: dmd_arm, model: arm.dmd.yaml, proportional: [base]}
"""
NEAR = "distances: [0.4, 0.6], width: 0.2, centre: [1.8, 0.0, 0.8]"
SLOW = ("bullet_crane", "mujoco_crane", "dmd_arm")


@pytest.mark.parametrize(
    "engine", ["kinematic_crane", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)]
)
def test_with_share_1_every_movement_succeeds_without_a_hand(engine: str, tmp_path: Path) -> None:
    if engine in {"bullet_crane", "dmd_arm"}:
        need("pybullet")
    written = text("share: 1", IDLE).replace("pairs: 1", "pairs: 2")
    if engine == "dmd_arm":
        written = written.replace(CRANE, ARM).replace("distances: [1, 2]", NEAR)
        for name in ("ied_arm.yaml", "arm.dmd.yaml"):
            shutil.copy(RETRIEVAL / name, tmp_path)
    seen = rehearse(a_study(tmp_path, written.replace("kinematic_crane", engine)))
    assert [row["outcome"] for row in seen.trials()] == ["success"] * 4
    assert not signal(seen, "assist.operator").any()


class Fixed(Controller):
    """Commands what it was told to."""

    def __init__(self, command: FloatArray) -> None:
        self.signals = (Signal("command", "rad/s", ("a", "b", "c")), Signal("more", "1"))
        self._command = command

    def command(self, axes: FloatArray, state: FloatArray) -> FloatArray:
        return np.array([*self._command, axes.sum()])

    def inverse(self, velocity: FloatArray, state: FloatArray) -> FloatArray:
        return np.zeros(1)


BUTTONS = (Signal("stick", "1"), Signal("button", "1"), Signal("assist.stick", "1"))


def test_the_command_is_the_blend_of_both_and_a_button_gives_all_to_the_operator() -> None:
    chance = np.random.default_rng(77)
    for share in (0.0, 1.0, *chance.uniform(size=48)):
        own, theirs = chance.normal(size=(2, 3))
        assist = Assist(use="toward_target", share=share, takeover="button")
        scheme = Assisted(Fixed(own), Fixed(theirs), assist)
        scheme.open(make_run(ch8(), axes=BUTTONS))
        scheme.begin_trial(Trial(1, 1, 1, PlannedTrial({}, 1.0)))
        blend = [(1.0 - share) * a + share * b for a, b in zip(own, theirs, strict=True)]
        for button, part, command in ((0.5, share, blend), (0.51, 0.0, own), (0.0, share, blend)):
            made = scheme.command(np.array([0.25, button, 9.0]), np.zeros(1))
            assert made.tolist() == [*command, 0.25 + button, part, *own, *theirs]
            assert (np.minimum(own, theirs) - 1e-15 <= made[:3]).all()
            assert (made[:3] <= np.maximum(own, theirs) + 1e-15).all()
        assert not scheme.idle().any()


TRACKED = text(
    "share: {half: 0.5, full: 1}",
    design="""design:
  tracks:
    help:
      factor: assist
      levels: {full: 1, half: 2}
      up_down: {reversals: 2, leave_out: 0}
      rounds: 2""",
    feedback="none",
    track="help",
)


@pytest.mark.slow
def test_a_group_a_block_a_condition_and_a_track_choose_the_share(tmp_path: Path) -> None:
    shares = "share: {half: 0.5, full: 1}"
    cases = {
        ("design: {groups: {helped: [half]}}", "feedback", "group"): ({0.5}, "half"),
        ("", "feedback", "[full]"): ({1.0}, "full"),
        ("design: {conditions: {a: [half], b: [half]}}", "condition", "1"): ({0.5}, "half"),
        ("", "feedback", "none"): ({0.0}, "none"),
    }
    for (design, key, value), (expected, named) in cases.items():
        seen = rehearse(a_study(tmp_path, text(shares, design=design, **{key: value})))
        moving = [frame.phase is not Phase.IDLE for frame in seen.frames]
        assert set(signal(seen, "assist.share")[moving, 0]) == expected
        assert {row["feedback"] for row in seen.trials()} == {named}
    seen = rehearse(a_study(tmp_path, TRACKED))
    of = {frame.trial: frame.command[seen.run.command.index("assist.share")]
          for frame in seen.frames if frame.phase is Phase.RUNNING}  # fmt: skip
    told = {row["trial"]: row["assist"] for row in seen.trials()}
    assert {"half", "full"} == {*told.values()}
    assert {number: {"half": 0.5, "full": 1.0}[name] for number, name in told.items()} == {
        number: of[number] for number in told
    }


def test_a_track_of_shares_is_in_the_codebook(tmp_path: Path) -> None:
    study = a_study(tmp_path, TRACKED)
    found = {(each.table, each.name): each for each in codebook(study)}
    assert found["trials", "assist"].definition
    assert found["command", "assist.operator.slew"].unit == "rad/s"
    assert "toward_target" in found["input", "assist.left.x"].source


WRONG = {
    "less than or equal to 1": text("share: 1.5"),
    "greater than or equal to 0": text("share: {half: -0.5}", feedback="[half]"),
    "switches on half, full, shares of assist, of one trial": text("share: {half: 0.5, full: 1}"),
    "there is no feedback 'haf'; did you mean 'half'": text("share: {half: 0.5}", feedback="[haf]"),
    "assist.takeover is 'left.trigge', and there is no such button": text(
        "share: 1, takeover: left.trigge"
    ),
    "assist moves left.x, right.y, and the scheme uses left.y, right.x": text(
        "share: 1, axes: [left.x, right.y]"
    ),
    "opposition_time needs an assistant; add assist:, or drop it": text(
        design="design: {primary: [opposition_time]}"
    ),
    "'half' is already the name of a feedback": text(
        "share: {half: 1}", design="feedback: {half: {use: sphere}}", feedback="[half]"
    ),
}


def test_a_track_and_conditions_do_not_both_choose_the_share(tmp_path: Path) -> None:
    """The share of the condition was applied, and the record named the track's."""
    design = (
        "design: {conditions: {a: [half], b: none}, tracks: {help: {factor: assist, measure: "
        "movement_time, at_most: 7, levels: {half: 1, full: 2}, up_down: {}}}}"
    )
    written = text("share: {half: 0.5, full: 1}", design=design, track="help", condition="1")
    with pytest.raises(ProtocolError, match="a track chooses the share of assist here"):
        a_study(tmp_path, written)


@pytest.mark.parametrize("said", WRONG)
def test_what_cannot_be_is_refused_before_a_session(said: str, tmp_path: Path) -> None:
    with pytest.raises(ProtocolError) as refused:
        a_study(tmp_path, WRONG[said])
    assert said in str(refused.value)


BLIND = """\
from labcrane import hookimpl, offer
from labcrane_aiming.aiming import Aiming
from labcrane_aiming.settings import AimingSettings

labcrane_api = 1


class Blind(Aiming):
    signals = ()


@hookimpl
def labcrane_tasks():
    return [offer("blind", AimingSettings, Blind)]
"""


def test_a_task_without_a_target_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "blind.py").write_text(BLIND)
    protocol = tmp_path / "study.yaml"
    protocol.write_text(text("share: 1").replace("use: aiming", "use: blind"))
    with pytest.raises(ProtocolError, match="assist needs the signal 'target"):
        load(protocol, discover(study=protocol))


@pytest.mark.slow
def test_a_session_replays_bit_for_bit_and_another_share_is_named(tmp_path: Path) -> None:
    shared = text("share: {half: 0.5}", feedback="[half]")
    path = run(visit(tmp_path / "whole", shared), ScriptedConsole())
    assert replay_session(path, 1).difference is None
    other = tmp_path / "other.yaml"
    other.write_text(shared.replace("half: 0.5", "half: 0.6"))
    again = replay_session(path, 1, protocol=other)
    assert "assist.share.half: recorded 0.5, now 0.6" in again.parts
    assert again.difference is not None


@pytest.mark.slow
def test_who_moved_what_sums_to_one_and_is_that_of_the_ticks(tmp_path: Path) -> None:
    shared = text("share: 0.3")
    session = open_recording(run(visit(tmp_path, shared), ScriptedConsole())).session(1)
    table, command = measure_session(session), session.streams["command"].data
    loop = session.streams["loop"].data
    for row in table.to_dict("records"):
        first = row["started"] + row["movement_onset"]
        inside = (loop["due"] >= first - 1e-6) & (
            loop["due"] <= first + row["movement_time"] + 1e-6
        )
        own, theirs = (command.filter(like=f"assist.{who}.")[inside].to_numpy()
                       for who in ("operator", "assistant"))  # fmt: skip
        moved = command.filter(regex=r"^command\.")[inside].to_numpy()
        assert np.array_equal(moved, (1.0 - 0.3) * own + 0.3 * theirs)
        paths = 0.7 * np.sqrt((own**2).sum(1)).sum(), 0.3 * np.sqrt((theirs**2).sum(1)).sum()
        assert row["operator_part"] == pytest.approx(paths[0] / sum(paths), rel=1e-9)
        assert row["operator_part"] + row["assistant_part"] == pytest.approx(1.0, abs=1e-12)
        assert row["assist_share"] == pytest.approx(0.3)
        opposed = (np.einsum("ij,ij->i", own, theirs) < 0.0).sum() / 60
        assert row["opposition_time"] == pytest.approx(opposed)


@pytest.mark.slow
def test_bids_has_the_condition_the_feedback_and_both_commands(tmp_path: Path) -> None:
    design = "design: {conditions: {shared: [half], alone: none}, order: {condition: latin_square}}"
    shared = text("share: {half: 0.5}", design=design, condition="1")
    session = open_recording(run(visit(tmp_path, shared), ScriptedConsole())).session(1)
    events = event_table(session)
    begun = events[(events["trial_type"] == "trial_start") & (events["counted"] == 1)]
    trials = session.trials.set_index("trial")
    for name in ("condition", "feedback", "distance", "pair", "practice"):
        assert begun[name].to_list() == trials[name][begun["trial"]].to_list(), name
    within = events[events["trial_type"] == "movement_onset"]
    assert set(within["condition"]) == {"shared"}
    about = event_description(events, session.context, {})
    assert about["condition"]["Description"] == "the condition within participants of the design"
    assert about["distance"]["Units"] == "m"
    (assist,) = [each for each in tracking_systems(session, 1) if each.label == "assist"]
    written = np.vstack([np.column_stack(chunk) for chunk in assist.samples()])[:, 1:]
    columns = list(assist.channels["name"][1:])
    assert {column.rpartition(".")[0] for column in columns} == {
        "assist", "assist.operator", "assist.assistant"
    }  # fmt: skip
    assert np.array_equal(written, session.streams["command"].data[columns])


@pytest.mark.slow
def test_a_simulated_assistant_is_not_the_simulated_operators_twin(tmp_path: Path) -> None:
    shared = text("share: 0.5").replace("use: toward_target", "use: simulated_operator")
    seen = rehearse(a_study(tmp_path, shared))
    places = [seen.run.axes.find(name) for name in ("left", "assist.left")]
    own, theirs = (np.array([frame.axes[place] for frame in seen.frames]) for place in places)
    assert not np.array_equal(own, theirs)


@pytest.mark.slow
def test_simulated_participants_run_it_without_a_compiled_kernel(tmp_path: Path) -> None:
    study = a_study(tmp_path, text("share: 0.5"))
    done = simulate(SimulationJob(study.path, None, tmp_path / "data", "P001"))
    (said,) = json.loads((done.path / "simulated_by.json").read_text())
    assert not said["compiled"]
    assert "operator, scheme has no compiled kernel" in said["why"]


def test_the_example_is_fine_and_has_the_shares_0_half_and_1() -> None:
    path = RETRIEVAL.parents[1] / "examples" / "assist" / "protocol.yaml"
    study = load(path, discover())
    assert list(questions(study)) == []
    assert study.protocol.assist
    shares = {block.condition: study.protocol.assist.share_in(block.trials[0])
              for block in plan_session(study, "P001", 1).blocks if block.condition}  # fmt: skip
    assert shares == {"alone": 0.0, "shared": 0.5, "automatic": 1.0}
