"""Methods paragraph, codebook and allocation: against what is recorded and planned."""

import csv
import io
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from governed import GOVERNED, GROUPED, PERSON, TODAY, Lab
from rehearsal import ScriptedConsole, a_study, loaded

import labcrane
from labcrane import ProtocolError
from labcrane.approval.decision import Grant, amend
from labcrane.approval.lock import lock_path, read_lock
from labcrane.approval.methods import methods
from labcrane.design.allocation import allocate, as_csv, balance
from labcrane.testing import Visit, main, plan_session, run

FACTORS = (
    GROUPED.replace("distances: [2]", "distances: [2, 3]")
    .replace(", pairs: 1", "")
    .replace(PERSON, "{use: dual_joystick}")
)
FRAMES = ("loop", "input", "command", "state", "task")


def ordered(rule: str, text: str = FACTORS) -> str:
    return text.replace("design:", f"design:\n  order: {{pairs: {rule}}}")


@pytest.mark.slow
def test_every_recorded_column_is_in_the_codebook_with_its_unit(tmp_path: Path) -> None:
    lab = Lab(tmp_path, GROUPED + "      - reference: {task: aiming, pairs: 1}\n")
    lab.approve()
    session = labcrane.open_recording(lab.run("P001")).session(1)
    assert {"group", "feedback", "reference"} <= set(session.trials.columns)
    rows = read_lock(lab.protocol).content["codebook"]
    book = {(row["table"], row["name"]): row for row in rows}
    assert len(book) == len(rows)
    recorded = {
        (name, column): unit
        for name in FRAMES
        for column, unit in session.streams[name].units.items()
    }
    assert {key: book[key]["unit"] for key in recorded} == recorded
    assert {name for table, name in book if table == "trials"} == set(session.trials.columns)
    assert {name for table, name in book if table == "events"} == set(session.events.columns)
    units = session.context["trial_units"]
    for name in session.trials.columns:
        numbers = session.trials[name].dtype.kind == "f"
        assert book["trials", name]["unit"] == (units.get(name, "1") if numbers else ""), name
    assert book["trials", "movement_time"]["source"] == "aiming: aiming"
    assert book["state", "joint.angle.slew"]["source"] == "bullet: kinematic_crane"
    assert not {key for key in book if key[0] in FRAMES} - set(recorded)


def test_the_methods_paragraph_says_what_was_approved_and_done(tmp_path: Path) -> None:
    text = ordered("{rule: blocked, times: 3, in_a_row: 1}").replace(
        "steps:", "after_days: [0, 3]\n    steps:\n      - consent"
    )
    text = text.replace("movements: 1}", "movements: 1, limit_s: 20}")
    lab = Lab(tmp_path, text)
    lock = lab.approve()
    said = methods(lock)
    for words in (
        "“A short study” was approved by Ethics board (reference KB-12/2026, valid until",
        "3 groups (none without feedback; visual with the feedback sphere; sound with the feedback "
        "tone) in permuted blocks of 3. ",  # of slots the register knows
        "CH8 knuckle boom",
        "at 240 Hz",
        "The task aiming had these settings: distances 2 and 3 m; movements 1; limit 20 s; by "
        "default: width 0.5 m; ",
        "; end rest inside; ",
        "; rest speed 0.02 m/s; rest 0.2 s; ",
        "; onset speed 0.02 m/s; onset hold 0.1 s. ",
        "The feedback tone (sonification) had default settings. ",
        "The levels of pairs came in randomised blocks, 3 times each, no more than 1 in a row",
        "Session 1 (only), 0 to 3 days after the one before, consisted of consent and the block "
        "aiming with all feedback. ",
        f"labcrane {labcrane.__version__}",
        lock.materials_sha256,
    ):
        assert words in said
    (tmp_path / "study.yaml").write_text(
        text.replace("movements: 1", "movements: 2"), encoding="utf-8"
    )
    grant = Grant("Ethics board", "A1", lab.grant().valid_until, lock.consent)
    amended = methods(amend(lab.study, lab.registry, grant, "too easy", TODAY))
    assert f"and amended: A1 on {TODAY} (too easy)" in amended


def test_the_steps_of_a_session_are_words_with_units_in_the_methods(tmp_path: Path) -> None:
    asked = "questionnaires: {effort: {use: nasa_tlx}, ease: {use: nasa_tlx}}\nsessions:"
    steps = (
        "steps:\n      - questionnaire: [effort, ease]\n      - break: {seconds: 120}\n"
        "      - questionnaire: effort"
    )
    text = GOVERNED.replace("sessions:", asked).replace("steps:", steps)
    lab = Lab(tmp_path, text)
    said = methods(lab.approve())
    assert (
        "consisted of the questionnaires effort and ease, a break of 120 s, the questionnaire "
        "effort and the block aiming. "
    ) in said


def test_the_methods_name_the_assistant_and_its_share_in_each_condition(tmp_path: Path) -> None:
    shares = "assist: {use: toward_target, takeover: right.trigger, share: {half: 0.5, full: 1}}"
    given = "conditions: {alone: none, shared: [half, tone], automatic: [full]}"
    text = GROUPED.replace("tasks:", f"{shares}\ntasks:").replace("design:", f"design:\n  {given}")
    text = text.replace("{task: aiming", "{task: aiming, condition: 1", 1)
    said = methods(Lab(tmp_path, text).approve())
    for words in (
        "An assistant (toward target) moved the machine together with them: the command of each "
        "joint was a weighted mean of both, with a share of the assistant, and the participant's "
        "alone while right.trigger was pressed. ",
        "3 conditions (alone without feedback and without assistance; shared with the feedback "
        "tone and with an assistant's share of 0.5; automatic without feedback and with an "
        "assistant's share of 1). ",
    ):
        assert words in said


def test_the_methods_and_the_codebook_name_each_estimate(tmp_path: Path) -> None:
    estimates = (
        "streams: {eeg: {name: Amplifier}}\n"
        "estimates: {load: {use: band_power, stream: eeg, channels: [Fz], per_channels: [Pz], "
        "fallback: {ratio: 1}}}\n"
    )
    assisted = "assist: {use: toward_target, share: {estimate: load.ratio, between: [1, 3], "
    assisted += "to: [0, 0.8], at_most_per_s: 0.2}}\n"
    rule = "stop_rules: [{estimate: load.ratio, above: 2.5}]\n"
    second = "secondary: {drt: {use: drt}}\n"
    lab = Lab(tmp_path, GROUPED.replace("tasks:", f"{estimates}{assisted}{rule}{second}tasks:"))
    lock = lab.approve()
    said = methods(lock)
    for words in (
        "The session paused for a decision of the experimenter when the mean of the estimate "
        "load.ratio over a trial was above 2.5. ",
        "The estimate load (band power) had these settings: stream eeg; ",
        "; by default: at most age 2 s; band 4 and 8 Hz; per band 8 and 13 Hz; window 2 s. ",
        "with a share that followed the estimate load.ratio (0 at 1, 0.8 at 3, changed by at most "
        "0.2 per second) of the assistant. ",
    ):
        assert words in said
    sources = {row["name"]: row["source"] for row in lock.content["codebook"]}
    assert sources["estimate.load.ratio"] == "estimates: band_power"
    assert sources["load_ratio"] == "estimates: band_power", "the mean over a trial"
    assert sources["drt_hit_rate"] == "drt: drt"
    defined = {row["name"]: row["definition"] for row in lock.content["codebook"]}
    assert defined["estimate.load.time"] == "time that the newest value stands for"
    assert defined["estimate.load.state"].startswith("state of the estimate: 0 ok, 1 warming up, ")


TRAINED = GROUPED.replace("design:", "design:\n  primary: [movement_time, absolute_error]").replace(
    "  - name: only",
    "  - name: before\n    steps:\n"
    "      - block: {task: aiming, feedback: none, name: pre-test}\n"
    "      - block: {task: aiming, feedback: group, name: training}\n"
    "      - block: {task: aiming, feedback: [tone], name: tones}\n  - name: only",
)


def test_the_methods_name_the_feedback_that_each_group_has_in_each_block(tmp_path: Path) -> None:
    lab = Lab(tmp_path, TRAINED)
    said = methods(lab.approve())
    assert "The primary outcomes were movement time and absolute error. " in said
    groups = dict(re.findall(r"(\w+) (without feedback|with the feedback \w+)[;)]", said))
    assert list(groups) == ["none", "visual", "sound"]
    names = {"without feedback": set(), "with all feedback": {"sphere", "tone"}}
    for session, blocks in enumerate((("pre-test", "training", "tones"), ("aiming",)), start=1):
        for slot in (1, 2, 3):
            plan = plan_session(lab.study, "P001", session, slot)
            assert len(plan.blocks) == len(blocks)
            for name, block in zip(blocks, plan.blocks, strict=True):
                label = name if name == "aiming" else f"{name} (aiming)"
                (given,) = re.findall(
                    rf"the block {re.escape(label)} (with(?:out| all| the) feedback[\w ]*?)"
                    r"(?=,|\.| and the block)",
                    said,
                )
                if given == "with the feedback of the group":
                    given = groups[plan.group]
                meant = names.get(given, {given.rpartition(" ")[2]})
                assert {frozenset(on) for on in block.feedback.values()} == {frozenset(meant)}


def test_methods_writes_the_codebook_beside_the_protocol(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = Lab(tmp_path)
    lab.approve()
    assert main(["methods", str(lab.protocol)]) == 0
    assert "was approved by Ethics board" in capsys.readouterr().out
    rows = list(
        csv.DictReader((tmp_path / "study.codebook.csv").read_text(encoding="utf-8").splitlines())
    )
    assert rows == read_lock(lab.protocol).content["codebook"]


def test_before_its_approval_a_study_has_the_same_paragraph_but_for_the_approval(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = Lab(tmp_path)
    assert main(["methods", str(lab.protocol), "--planned"]) == 0
    before = capsys.readouterr().out
    assert not lock_path(lab.protocol).exists()
    lab.approve()
    assert main(["methods", str(lab.protocol)]) == 0
    after = capsys.readouterr().out
    said = re.sub(
        r"was approved by .*? valid until [\d-]+\)", "is planned, and not approved yet", after
    )
    said = said.replace("were locked", "are not locked yet")
    of_consent = re.compile(r"[0-9a-f]{64}")
    assert of_consent.sub("", before) == of_consent.sub("", said)


def orders(text: str, folder: Path, count: int) -> list[tuple[str, ...]]:
    study = a_study(folder, text)
    found = []
    for slot in range(1, count + 1):
        plan = plan_session(study, "P001", 1, slot)
        found.append(plan.blocks[0].levels["pairs"])
    return found


@pytest.mark.parametrize(("rule", "count"), [("williams", 12), ("latin_square", 12)])
def test_within_each_group_every_row_of_the_square_is_used(
    tmp_path: Path, rule: str, count: int
) -> None:
    study = a_study(tmp_path, ordered(rule))
    plans = [plan_session(study, "P001", 1, slot) for slot in range(1, count + 1)]
    by_group: dict[str, list[tuple[str, ...]]] = {}
    for plan in plans:
        by_group.setdefault(plan.group, []).append(plan.blocks[0].levels["pairs"])
    assert {group: len(found) for group, found in by_group.items()} == {
        "none": 4, "visual": 4, "sound": 4,
    }  # fmt: skip
    for found in by_group.values():
        assert len(set(found)) == 4
        placed = Counter((at, level) for order in found for at, level in enumerate(order))
        assert set(placed.values()) == {1}
        if rule == "williams":
            followed = Counter(pair for order in found for pair in pairwise(order))
            assert set(followed.values()) == {1}
            assert len(followed) == 12


def test_the_balance_of_36_participants_is_checked_and_exported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(ordered("williams"), encoding="utf-8")
    export = tmp_path / "plan.csv"
    assert main(["plan", str(path), "--participants", "36", "--export", str(export)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "balanced: groups of equal size: none 12, visual 12, sound 12" in said
    for group in ("none", "visual", "sound"):
        where = f"pairs (williams, group {group})"
        assert f"balanced: {where}: every level in every position 3 times" in said
        assert f"balanced: {where}: every level follows every other 3 times" in said
    assert "not balanced" not in said
    rows = list(csv.DictReader(export.read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 36
    study = loaded(path)
    for row in (rows[0], rows[20]):
        plan = plan_session(study, row["participant"], 1)
        assert (row["group"], int(row["seed"]), int(row["slot"])) == (
            plan.group, plan.seed, plan.slot,
        )  # fmt: skip
        assert tuple(row["order"].split()) == plan.blocks[0].levels["pairs"]


def test_the_balance_of_a_few_is_that_of_all_who_are_planned(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "study.yaml"
    planned = ordered("williams").replace("title:", "participants: {planned: 36}\ntitle:")
    path.write_text(planned, encoding="utf-8")
    assert main(["plan", str(path), "--participants", "1"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "P001: slot 1" in said
    assert "P002" not in said
    assert "of all 36 planned: balanced: groups of equal size: none 12, visual 12" in said
    assert "not balanced" not in said


def test_what_is_not_balanced_is_told_with_what_would_be(tmp_path: Path) -> None:
    study = a_study(tmp_path, ordered("williams"))
    names = {f"P{number:03}": None for number in range(1, 8)}
    told = balance(study, allocate(study, names))
    assert told[0].startswith("not balanced: groups: ")
    assert told[0].endswith("they are equal for a multiple of 3 participants")
    assert any("a multiple of 4 participants per group" in line for line in told[1:])
    assert len(list(csv.reader(io.StringIO(as_csv(allocate(study, names)))))) == 8


@pytest.mark.slow
def test_a_simulated_participants_slot_is_its_number(tmp_path: Path) -> None:
    study = a_study(tmp_path, ordered("latin_square"))
    visit = Visit(study, "P011", 1, tmp_path / "data", simulated=True, fast=True)
    session = labcrane.open_recording(run(visit, ScriptedConsole())).session(1)
    plan = plan_session(study, "P011", 1, 11)
    assert session.attrs["slot"] == 11
    assert session.attrs["group"] == plan.group
    assert not (tmp_path / "data" / "register").exists()


@pytest.mark.parametrize(
    ("order", "said"),
    [
        ("{rule: williams, in_a_row: 2}", "the rule 'williams' has no random order; remove"),
        ("{rule: random}", "'random' is not a rule; use one of as_written, blocked, latin_square"),
        ("{rule: shuffled, times: 0}", r"times is 0; it must be greater than 0"),
    ],
)  # fmt: skip
def test_an_impossible_order_is_told(tmp_path: Path, order: str, said: str) -> None:
    with pytest.raises(ProtocolError, match=said):
        a_study(tmp_path, ordered(order))
