"""Conditions within participants: their orders, what blocks of them are given, and mistakes."""

import itertools
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from fed_study import FED
from rehearsal import DiesError, DiesInTrial, ScriptedConsole, a_study

import labcrane
from labcrane import ProtocolError
from labcrane.design.allocation import allocate, balance
from labcrane.protocol.questions import questions
from labcrane.testing import Study, Visit, plan_session, run

HEAD, _, _ = FED.partition("design:")
ASIDE = "  aside: {use: sonification, far: 3.0}\n"
TWO = "{plain: none, tone: [tone]}"
BLOCKS = "".join(f"      - block: {{task: aiming, pairs: 1, condition: {n}}}\n" for n in (1, 2))


def written(
    conditions: str = TWO, order: str = "latin_square", blocks: str = BLOCKS, more: str = ""
) -> str:
    ordered = f"  order: {{condition: {order}, pairs: shuffled}}\n" if order else ""
    return (
        f"{HEAD}design:\n  conditions: {conditions}\n{ordered}{more}"
        f"sessions:\n  - name: only\n    steps:\n{blocks}"
    )


def orders(study: Study, slots: range) -> list[tuple[str, ...]]:
    return [
        tuple(block.condition for block in plan_session(study, f"P{slot:03}", 1, slot).blocks)
        for slot in slots
    ]


def test_of_each_two_participants_one_has_each_order_in_a_sequence_nobody_can_tell(
    tmp_path: Path,
) -> None:
    found = orders(a_study(tmp_path, written()), range(1, 65))
    both = {("plain", "tone"), ("tone", "plain")}
    assert all({*found[at : at + 2]} == both for at in range(0, 64, 2))
    firsts = Counter(found[::2])
    assert set(firsts) == both
    assert min(firsts.values()) >= 8, "the first of two is drawn"


def test_williams_orders_are_balanced_for_what_came_before(tmp_path: Path) -> None:
    three = "{a: none, b: [tone], c: [ball]}"
    blocks = "".join(
        f"      - block: {{task: aiming, pairs: 1, condition: {n}}}\n" for n in (1, 2, 3)
    )
    found = orders(a_study(tmp_path, written(three, "williams", blocks)), range(1, 13))
    assert len(set(found)) == 6
    assert set(Counter(found).values()) == {2}
    follows = Counter(pair for order in found for pair in itertools.pairwise(order))
    assert len(set(follows.values())) == 1


def test_orders_are_balanced_in_each_group_and_the_plan_says_so(tmp_path: Path) -> None:
    study = a_study(tmp_path, written(more="  groups: {seen: [ball], heard: [tone]}\n"))
    allotted = allocate(study, {f"P{slot:03}": slot for slot in range(1, 17)})
    for group in ("seen", "heard"):
        first = {each.participant: each.condition for each in allotted[::-1] if each.group == group}
        assert Counter(first.values()) == {"plain": 4, "tone": 4}
    assert not any("not balanced" in line for line in balance(study, allotted))


def test_a_participant_keeps_the_order_in_all_sessions_whoever_else_came(tmp_path: Path) -> None:
    text = written() + "  - name: later\n    steps:\n" + BLOCKS
    study = a_study(tmp_path, text)
    for slot in (7, 2, 5):
        one, other = (plan_session(study, f"P{slot:03}", number, slot) for number in (1, 2))
        assert [b.condition for b in one.blocks] == [b.condition for b in other.blocks]


def test_a_block_has_the_feedback_of_its_condition_and_its_trials_say_which(
    tmp_path: Path,
) -> None:
    for slot in (1, 2):
        plan = plan_session(a_study(tmp_path, written()), f"P{slot:03}", 1, slot)
        for block in plan.blocks:
            assert {t.planned.condition["condition"] for t in block.trials} == {block.condition}
            given = {"plain": (), "tone": ("tone",)}[block.condition]
            assert set(block.feedback.values()) == {given}


@pytest.mark.slow
def test_a_session_that_was_killed_goes_on_in_its_order_and_its_record_says_it(
    tmp_path: Path,
) -> None:
    study = a_study(tmp_path, written())
    visit = Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True)
    plan = plan_session(study, "P001", 1, 1)
    with pytest.raises(DiesError):
        run(visit, DiesInTrial(plan.blocks[1].trials[1].number, 20))
    path = run(replace(visit, resumed=True), ScriptedConsole())
    trials = labcrane.open_recording(path).session(1).trials
    said = [
        (int(row.trial), row.condition) for row in trials.itertuples() if row.outcome == "success"
    ]
    expected = [
        (trial.number, block.condition)
        for block in plan.blocks
        for trial in block.trials
        if trial.planned.counted
    ]
    assert said == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (written("{plain: none}", ""), "'plain' is the only condition; write two or more"),
        (written("{plain: none, tone: [tune]}"), "tune"),
        (written("{plain: none, tone: group}"), "feedback is by group, but design has no groups"),
        (written(blocks=BLOCKS.replace("condition: 2", "condition: 3")),
         "condition is 3, and each participant has 2 of plain, tone; write 1 to 2"),
        (written(blocks=BLOCKS.replace("condition: 2", "condition: 2, feedback: all")),
         "the block has a condition, which says which feedback is on, and feedback"),
        (written().replace(f"  conditions: {TWO}\n", ""), "design has no conditions; write them"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_what_to_write(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ProtocolError, match=said):
        a_study(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (written(blocks=BLOCKS.splitlines(keepends=True)[0]),
         "no block has condition: 2, of 2, so that each participant lacks a condition"),
        (written(blocks=BLOCKS.replace("pairs: 1, condition: 2", "pairs: 2, condition: 2")),
         "the blocks of the conditions differ in task, repeat or levels"),
        (written("{ball: [ball], tone: [aside]}").replace("design:", f"{ASIDE}design:", 1),
         "conditions 'ball' and 'tone' do not give the same information: in 'tone' alone people"),
        (written("{plain: none, also: []}"), "'plain' and 'also' are given the same feedback"),
        (written(order=""), "conditions come in one order for everybody and their effect"),
    ],
)  # fmt: skip
def test_a_design_that_cannot_tell_its_conditions_apart_is_asked_about(
    text: str, said: str, tmp_path: Path
) -> None:
    asked = [each.text for each in questions(a_study(tmp_path, text))]
    assert any(said in each for each in asked), asked
    assert not any(said in each.text for each in questions(a_study(tmp_path, written())))
