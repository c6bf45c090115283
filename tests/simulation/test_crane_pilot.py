"""The crane study as it was run: what its protocol promises, and that it can be rehearsed."""

from pathlib import Path

import numpy as np
import pytest
from needs import needs
from rehearsal import loaded

import labcrane
from labcrane.protocol.questions import questions
from labcrane.testing import Study, main, plan_session

FOLDER = Path(__file__).parents[2] / "protocols" / "crane_pilot"
ITEMS = ("age", "gender", "experience", "handedness")


@pytest.fixture(scope="module")
def study() -> Study:
    return loaded(FOLDER / "protocol.yaml")


def test_nobody_is_given_feedback_and_no_window_tells_the_error(study: Study) -> None:
    assert study.protocol.design.groups == {}
    assert study.cues == study.sounds == {}
    assert questions(study) == ()


def test_36_people_each_move_four_times_between_eight_pairs_in_an_order_of_their_own(
    study: Study,
) -> None:
    assert study.protocol.participants.planned == 36
    orders = set()
    for number in range(1, 37):
        plan = plan_session(study, f"P{number:03}", 1, number)
        trials = [trial.planned for block in plan.blocks for trial in block.trials]
        counted = [str(trial.condition["pair"]) for trial in trials if trial.counted]
        order = tuple(counted[::4])
        assert counted == [pair for pair in order for _ in range(4)]
        assert len(set(order)) == 8
        orders.add(order)
    assert len(orders) == 36
    assert plan_session(study, "P001", 1).blocks == plan_session(study, "P001", 1).blocks


def test_a_session_waits_for_eeg_and_eye_tracker(study: Study) -> None:
    needs = {name: (need.type, need.required) for name, need in study.protocol.streams.items()}
    assert needs == {"eeg": ("EEG", True), "gaze": ("Gaze", True)}


def test_the_operator_has_two_screens_and_the_examiner_a_third(study: Study) -> None:
    settings = {name: choice.settings.model_dump() for name, choice in study.views.items()}
    assert {name: one["seen_by"] for name, one in settings.items()} == {
        "operator": "operator",
        "examiner": "examiner",
    }
    assert tuple(settings["operator"]["screens"]) == (1, 2)
    assert settings["operator"]["bezel_mm"] > 0
    assert settings["examiner"]["screen"] == 0


def test_both_protocols_say_in_their_head_what_is_the_papers_and_what_is_ours() -> None:
    for name in ("crane_pilot", "aiming"):
        text = (FOLDER.parent / name / "protocol.yaml").read_text()
        head = text.partition("\nlabcrane:")[0]
        assert "# From the paper:" in head
        assert "# Ours" in head


@needs("mujoco")
def test_a_folder_stands_for_its_protocol(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(FOLDER)]) == 0
    said = capsys.readouterr()
    assert "study 'crane_pilot' is fine" in said.out
    assert "warning" not in said.out + said.err
    assert main(["check", str(tmp_path)]) == 2
    assert (
        f"there is no protocol.yaml in {tmp_path}, nor another protocol" in capsys.readouterr().err
    )


def simulated_pilot(folder: Path, participants: int) -> Path:
    """Simulate some people of the study, without an engine and at 60 Hz; return their data."""
    text = (FOLDER / "protocol.yaml").read_text().replace("rate_hz: 240", "rate_hz: 60")
    text = text.replace("mujoco_crane, actuator: ideal", "kinematic_crane")
    (folder / "protocol.yaml").write_text(text)
    for name in ("instructions.md", "cohort.yaml"):
        (folder / name).write_text((FOLDER / name).read_text())
    words = ["simulate", str(folder), "--participants", str(participants)]
    assert main([*words, "--out", str(folder / "data")]) == 0
    return folder / "data"


@pytest.mark.slow
def test_a_simulated_participant_has_both_times_demographics_and_errors_that_nothing_cuts_off(
    tmp_path: Path,
) -> None:
    out = simulated_pilot(tmp_path, 1)
    session = labcrane.open_recording(out / "P001-SIMULATED" / "P001-SIMULATED.h5").session(1)
    trials = session.trials
    assert len(trials) == 32
    assert trials["error_bound"].isna().all()
    done = trials[trials["outcome"] == "success"]
    np.testing.assert_allclose(
        done["circle_to_circle"], done["movement_onset"] + done["movement_time"], rtol=1e-9
    )
    rests = done["onset_to_rest"]
    assert rests.notna().all()
    assert (rests < done["movement_time"]).all()
    np.testing.assert_allclose(rests + done["at_rest"], done["movement_time"], rtol=1e-9)
    # A trial begins with the tap that ends the one before, so the next tap is its end.
    np.testing.assert_allclose(done["circle_to_circle"], done["ended"] - done["started"], atol=0.02)
    assert (done["between_circles"].dropna() < done["circle_to_circle"]).all()
    assert set(session.questionnaires["item"]) == set(ITEMS)
