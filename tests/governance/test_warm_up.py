"""Practice that ends when it has been enough, and consent as a step."""

from pathlib import Path

import pytest
from rehearsal import SHORT, a_study, loaded, rehearse

from labcrane import ProtocolError

ROOT = Path(__file__).parents[2]
ENOUGH = SHORT.replace(
    "steps:\n",
    "steps:\n      - consent\n"
    "      - practice: {task: aiming, pairs: 1, until: {successes: 3, rounds: 4}}\n",
)


def practised(seen) -> list[str]:
    return [trial["outcome"] for trial in seen.trials() if trial["practice"]]


@pytest.mark.slow
def test_practice_ends_as_soon_as_enough_in_a_row_succeeded(tmp_path: Path) -> None:
    seen = rehearse(a_study(tmp_path, ENOUGH))
    assert practised(seen) == ["success"] * 3  # the second round of two ends in its middle
    (end,) = seen.events("practice.end")
    assert end.data["met"] is True
    assert len([trial for trial in seen.trials() if not trial["practice"]]) == 2
    assert len(seen.events("block.start")) == 3  # two rounds of practice and the block
    steps = [event.data["step"] for event in seen.events("step.end")]
    assert steps == [1, 2, 3, 4, 5, 6]  # rounds that were not needed are done as well


@pytest.mark.slow
def test_practice_that_was_not_enough_says_so_and_goes_on(tmp_path: Path) -> None:
    text = ENOUGH.replace("successes: 3, rounds: 4", "successes: 9, rounds: 2")
    seen = rehearse(a_study(tmp_path, text))
    assert practised(seen) == ["success"] * 4
    (end,) = seen.events("practice.end")
    assert (end.data["met"], end.data["in_a_row"], end.data["wanted"]) == (False, 4, 9)


@pytest.mark.slow
def test_two_practices_count_by_themselves(tmp_path: Path) -> None:
    practice = "      - practice: {task: aiming, pairs: 1, until: {successes: 1, rounds: 2}}\n"
    seen = rehearse(a_study(tmp_path, SHORT.replace("steps:\n", f"steps:\n{practice}{practice}")))
    assert practised(seen) == ["success"] * 2
    assert [event.data["met"] for event in seen.events("practice.end")] == [True, True]


@pytest.mark.slow
def test_consent_is_a_step_of_the_record(tmp_path: Path) -> None:
    seen = rehearse(a_study(tmp_path, ENOUGH))
    assert seen.names.index("consent.asked") < seen.names.index("block.start")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("- practice: {", "- block: {", "only practice can have a criterion; remove until"),
        ("- consent", "- consent: P001", "consent is a step by itself; write '- consent'"),
        ("successes: 3", "successes: 0", "must be greater than 0"),
        ("steps:\n", "after_days: [3, 1]\n    steps:\n", "earliest day, 3, is after the latest"),
    ],
)  # fmt: skip
def test_a_step_that_makes_no_sense_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(ProtocolError, match=said):
        a_study(tmp_path, ENOUGH.replace(old, new, 1))


@pytest.mark.parametrize("variant", ["protocol", "joysticks", "keyboard"])
def test_nobody_meets_a_scene_of_retrieval_first_where_it_is_measured(variant: str) -> None:
    """As many successes as scenes end no practice before each scene has come once."""
    study = loaded(ROOT / "protocols" / "retrieval" / f"{variant}.yaml")
    (session,) = study.protocol.sessions
    kinds = [step.kind for step in session.steps]
    (practice,) = [step.block for step in session.steps if step.kind == "practice"]
    assert practice is not None
    assert practice.until is not None
    assert kinds.index("practice") < kinds.index("reference")
    scenes = study.tasks[practice.task].factors()["scenes"]
    assert practice.until.successes >= len(scenes) == len(set(scenes))
