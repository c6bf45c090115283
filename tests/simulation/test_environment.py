"""A study as gymnasium's environment: the same task and machine, and a policy as an input."""

import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from results.recorded import STUDY
from results.recorded import study as a_study

from labcrane import ProtocolError, open_recording
from labcrane.simulation.environment import StudyEnvironment

SHORT = STUDY.replace("movements: 2}", "movements: 2, limit_s: 0.5}")


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    return a_study(tmp_path / "study", SHORT).path


def test_gymnasium_makes_a_study_and_finds_nothing_wrong(protocol: Path) -> None:
    made = gymnasium.make("labcrane/Study-v0", protocol=protocol)
    with warnings.catch_warnings():
        # Angles and positions have no bounds that hold for every machine.
        warnings.filterwarnings("ignore", message=".*Box observation space .*infinity.*")
        check_env(made.unwrapped, skip_render_check=True)
    made.close()


def test_trials_end_by_the_studys_own_rules_and_the_next_follows(protocol: Path) -> None:
    env = StudyEnvironment(protocol)
    trials = []
    for _ in range(3):
        env.reset()
        cut = False
        count = 0
        while not cut:
            _, reward, ended, cut, info = env.step(np.zeros(env.action_space.shape))
            assert (reward, ended) == (0.0, False)
            count += 1
        assert info["outcome"] == "timeout"
        assert abs(count - 60) <= 1  # half a second at 120 Hz, of which reset took one tick
        trials.append(info["trial"])
        with pytest.raises(ProtocolError, match="no trial is running; reset begins the next one"):
            env.step(np.zeros(env.action_space.shape))
    assert trials == sorted(set(trials))
    env.close()


def test_what_is_no_action_is_refused(protocol: Path) -> None:
    env = StudyEnvironment(protocol)
    env.reset(seed=1)
    for wrong in (
        np.full(env.action_space.shape, 1.5),
        np.zeros(1),
        np.full(env.action_space.shape, np.nan),
    ):
        with pytest.raises(
            ProtocolError, match=r"an action has \d+ axes from -1 to 1 \(input.left.x,"
        ):
            env.step(wrong)
    env.close()


def test_a_recorded_policy_moves_the_machine_as_it_did_when_it_is_an_input(
    protocol: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "policy"
    env = StudyEnvironment(protocol, record=folder)
    dice = np.random.default_rng()
    seen = []
    for _ in range(2):
        env.reset()
        over = False
        while not over:
            observation, _, ended, cut, _ = env.step(dice.uniform(-1, 1, env.action_space.shape))
            seen.append(observation)
            over = ended or cut
    env.close()
    file = folder / "policy.h5"
    record = open_recording(file).session(1)
    state = record.streams["state"].data.to_numpy()
    got = np.array(seen)[:, : state.shape[1]]
    rows = {row.tobytes() for row in np.ascontiguousarray(state)}
    assert {row.tobytes() for row in np.ascontiguousarray(got)} <= rows

    again = StudyEnvironment(_with_input(protocol, file), record=tmp_path / "again")
    device = again._study.input.build(again._study.machine)
    axes = record.streams["input"].data.to_numpy()
    again.reset()
    for tick in range(again._session.frame.tick.number + 1, len(axes)):
        given = device.read(_Tick(tick), None)
        np.testing.assert_array_equal(given, axes[tick])
        if not again._session.acting:
            break
        observation, *_ = again.step(given)
        np.testing.assert_array_equal(observation[: state.shape[1]], state[tick])
    again.close()


def _with_input(protocol: Path, file: Path) -> Path:
    text = protocol.read_text(encoding="utf-8")
    path = protocol.with_name("again.yaml")
    path.write_text(
        text.replace("input: {use: dual_joystick}", f"input: {{use: recorded, file: {file}}}"),
        encoding="utf-8",
    )
    return path


class _Tick:
    def __init__(self, number: int) -> None:
        self.number = number
