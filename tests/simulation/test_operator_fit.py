"""An operator fitted to a recording: what went into a simulation is found again."""

import json
from pathlib import Path

import numpy as np
import pytest
from cranes import needs_bullet
from dmd_arms import with_files
from ruamel.yaml import YAML

from labcrane import RecordingError
from labcrane.cli.app import main
from labcrane.protocol.study import load
from labcrane.registry.registry import discover
from labcrane_operator.fitting import fit_operator
from labcrane_operator.strokes import least_jerk_duration, read_strokes

STUDY = """\
labcrane: 1
study: fitted
title: Movements of four lengths
participants: {{pattern: 'P\\d{{3}}', planned: 1}}
rate_hz: 60
machine: ch8
input: {{use: dual_joystick}}
operator: {operator}
scheme:
  use: joint_velocity
  map: {{slew: left.x, elbow: left.y, wrist: right.x, shoulder: -right.y}}
dynamics: {{use: kinematic_crane}}
tasks:
  aiming: {{use: aiming, distances: {distances}, movements: {movements}}}
design:
  order: {{pairs: shuffled}}
sessions:
  - {{name: one, steps: [{{block: {{task: aiming}}}}]}}
"""
ANOTHER_TASK = """\
labcrane: 1
study: another
title: Touch something
participants: {pattern: 'P\\d{3}', planned: 1}
machine: ied_arm.yaml
input: {use: gateway}
operator: {use: scenario_operator}
scheme: {use: valve}
dynamics:
  use: dmd_arm
  model: arm.dmd.yaml
  proportional: [base]
  scenes: [scenes/touch.yaml]
tasks: {reach: {use: scenario, scenes: [scenes/touch.yaml], limit_s: 1}}
sessions: [{name: only, steps: [{block: {task: reach}}]}]
"""
WENT_IN = {
    "reaction_s": 0.5,
    "reaction_sd": 0.15,
    "lapse_rate": 0.2,
    "lapse_s": 1.5,
    "fitts_a_s": 2.0,
    "fitts_b_s": 1.6,
    "learning_gain": 0.7,
    "learning_rate": 0.15,
    "endpoint_noise": 0.03,
}


def simulated(
    folder: Path,
    distances: str = "[2, 3, 4, 6]",
    movements: int = 4,
    people: int = 1,
    block: str = "{task: aiming}",
    **own: float,
) -> Path:
    """Simulate a study; return its data folder."""
    operator = {"use": "simulated_operator", **own}
    text = STUDY.format(
        operator=json.dumps(operator),
        distances=distances,
        movements=movements,
    ).replace("{task: aiming}", block)
    (folder / "protocol.yaml").write_text(text)
    data = folder / "data"
    order = ["simulate", str(folder / "protocol.yaml"), "--out", str(data)]
    assert main([*order, "--participants", str(people)]) == 0
    return data


def of(data: Path, number: int = 1) -> Path:
    name = f"P{number:03}-SIMULATED"
    return data / name / f"{name}.h5"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return of(simulated(tmp_path_factory.mktemp("fitted"), **WENT_IN))


@pytest.mark.slow
def test_what_went_into_a_simulation_is_found_again(recording: Path) -> None:
    """Within twice the 95 % intervals: nine of them hold all at once less often than one does."""
    fitted = fit_operator(read_strokes(recording, 1))
    assert set(fitted) == set(WENT_IN)
    for name, true in WENT_IN.items():
        assert fitted[name].interval is not None
        low, high = fitted[name].interval
        reach = high - low
        assert low - reach / 2 <= true <= high + reach / 2, f"{name}: {low} to {high}"
    assert fitted["fitts_b_s"].value == pytest.approx(1.6, rel=0.05)
    assert fitted["learning_rate"].value == pytest.approx(0.15, rel=0.1)


@pytest.mark.slow
def test_a_fitted_operator_is_a_part_that_a_protocol_takes(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = tmp_path / "operator.yaml"
    assert main(["operator", "fit", str(recording), "--out", str(part)]) == 0
    said = capsys.readouterr().out
    assert "session 1 of P001-SIMULATED.h5, 32 movements" in said
    assert "pace_sd: a difference between people" in said
    text = STUDY.format(operator="{}", distances="[2, 4]", movements=2)
    path = tmp_path / "protocol.yaml"
    path.write_text(text.replace("operator: {}\n", part.read_text()))
    settings = load(path, discover()).operator.settings.model_dump()
    written = YAML(typ="safe").load(part)["operator"]
    assert set(written) == {"use", *WENT_IN}
    assert {name: settings[name] for name in WENT_IN} == {name: written[name] for name in WENT_IN}


@pytest.mark.slow
def test_who_does_not_learn_is_given_no_learning_rate(tmp_path: Path) -> None:
    data = simulated(tmp_path, learning_gain=0.0)
    fitted = fit_operator(read_strokes(of(data), 1))
    assert fitted["learning_gain"].value == 0.0
    assert fitted["learning_gain"].interval is None
    assert "learning_rate" not in fitted


def test_the_duration_of_a_movement_of_least_jerk_is_found_from_a_part_of_it() -> None:
    time = np.linspace(0.0, 4.0, 400)
    u = np.clip((time - 0.5) / 3.0, 0.0, 1.0)
    progress = 2.0 * (10 * u**3 - 15 * u**4 + 6 * u**5)
    part = slice(90, 300)
    found = least_jerk_duration(time[part], progress[part] - progress[90])
    assert found == pytest.approx(3.0, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("distances", "movements", "what"),
    [
        ("[2]", 2, "there are 4 movements with a main stroke, and an operator is fitted to at "),
        ("[2]", 4, "the movements' difficulties differ by "),
    ],
)
def test_too_little_to_fit_is_refused(
    tmp_path: Path, distances: str, movements: int, what: str
) -> None:
    strokes = read_strokes(of(simulated(tmp_path, distances, movements)), 1)
    with pytest.raises(RecordingError) as refused:
        fit_operator(strokes)
    assert str(refused.value).startswith(what)
    assert "; choose a" in str(refused.value)


@pytest.mark.slow
def test_a_session_without_counted_movements_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of five people who leave in one of two trials, some leave in the first, an approach."""
    (tmp_path / "cohort.yaml").write_text("labcrane_cohort: 1\ndropout: 1.0\n")
    data = simulated(tmp_path, "[2]", 1, people=5, block="{task: aiming, pairs: 1}")
    capsys.readouterr()
    assert [main(["operator", "fit", str(of(data, n))]) for n in range(1, 6)] == [1] * 5
    said = capsys.readouterr().err
    assert "has no counted movements, and an operator is fitted to those; choose another" in said


@needs_bullet
def test_another_task_than_aiming_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = with_files(tmp_path) / "protocol.yaml"
    path.write_text(ANOTHER_TASK)
    assert main(["simulate", str(path), "--out", str(tmp_path / "data")]) == 0
    assert main(["operator", "fit", str(of(tmp_path / "data"))]) == 1
    assert "so it is not of the task 'aiming'; an operator" in capsys.readouterr().err
