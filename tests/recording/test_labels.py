"""Labels of events: few, the same in every session, and with what the trial is about."""

import ast
import random
import re

import pytest
from docs.page import ROOT

from labcrane.core.events import CODES, KINDS, OTHER, PULSES
from labcrane.recording import labelled
from labcrane.recording.labels import LONGEST, plain
from labcrane.testing import Order

BLOCK = {"block": 2, "block_name": "learning", "task": "aiming", "practice": False}
TRIAL = {
    "trial": 3, "attempt": 1, **BLOCK, "counted": True, "group": "a", "reference": True,
    "pair": "2m far/right", "distance": 2.0, "movement": 1, "loaded": True,
    "scene": "x" * (LONGEST + 1), "feedback": "ball+tone",
}  # fmt: skip
LEVELS = "block=learning/pair=2m_far_right/loaded=true/feedback=ball+tone"


def test_a_trial_s_events_have_its_block_and_condition_and_others_have_none() -> None:
    told = [
        ("session.start", {"title": "a study"}), ("pause.start", {"why": "tired"}),
        ("block.start", BLOCK), ("order.note", {"text": "a note"}), ("trial.start", TRIAL),
        ("target.entered", {"trial": 3}),
        ("trial.end", {**TRIAL, "outcome": "success", "mood": "good", "error": 0.1}),
        ("pause.start", {}), ("block.end", BLOCK), ("session.end", {}),
    ]  # fmt: skip
    assert labelled(told) == [
        "session_start", "pause_start", "block_start/block=learning", "order_note/block=learning",
        f"trial_start/{LEVELS}", f"target_entered/{LEVELS}", f"trial_end/{LEVELS}/outcome=success",
        "pause_start/block=learning", "block_end/block=learning", "session_end",
    ]  # fmt: skip


def test_a_trial_whose_process_died_is_ended_under_its_own_levels() -> None:
    told = [
        ("trial.start", TRIAL), ("session.start", {}),
        ("trial.end", {**TRIAL, "outcome": "interrupted"}), ("pause.start", {}),
        ("block.start", {**BLOCK, "practice": True}),
    ]  # fmt: skip
    void = LEVELS.replace("/pair", "/void/pair")
    assert labelled(told)[1:] == [
        "session_start", f"trial_end/{void}/outcome=interrupted", "pause_start",
        "block_start/block=learning/practice",
    ]  # fmt: skip


def test_a_fault_of_a_signal_says_where_and_what_it_is() -> None:
    about = {"stream": "Brain Amp", "channel": "Fz", "kind": "flat line", "message": "why"}
    assert labelled([("block.start", BLOCK), ("signal.bad", about)])[1] == (
        "signal_bad/block=learning/stream=Brain_Amp/channel=Fz/kind=flat_line"
    )
    assert labelled([("signal.good", {**about, "channel": ""})]) == [
        "signal_good/stream=Brain_Amp/kind=flat_line"
    ]


@pytest.mark.parametrize("seed", range(20))
def test_an_attempt_is_void_if_it_was_broken_off_or_made_again_and_no_other_is(seed: int) -> None:
    draws = random.Random(seed)
    told, void = [], []
    for trial in range(1, 6):
        attempts = draws.randint(1, 3)
        for attempt in range(1, attempts + 1):
            about = {**BLOCK, "trial": trial, "attempt": attempt, "counted": draws.random() < 0.5}
            outcome = draws.choice(["success", "timeout", "repeated", "ended", "interrupted"])
            told += [("trial.start", about), ("target.entered", {"trial": trial})]
            told += [("trial.end", {**about, "outcome": outcome})]
            again = attempt < attempts or outcome in {"repeated", "ended", "interrupted"}
            void += [(about["counted"], again)] * 3
    found = [label.split("/") for label in labelled(told)]
    assert [("uncounted" not in parts, "void" in parts) for parts in found] == void


@pytest.mark.parametrize("seed", range(20))
def test_whatever_a_condition_says_a_label_has_its_parts_and_no_others(seed: int) -> None:
    draws = random.Random(seed)
    signs = "aZ9é /=\\,;\"'\n{}|+-._"
    condition = {
        "".join(draws.choices(signs, k=6)): "".join(draws.choices(signs, k=draws.randint(0, 12)))
        for _ in range(draws.randint(0, 5))
    }
    (label,) = labelled([("trial.start", {**BLOCK, **condition})])
    name, block, *levels = label.split("/")
    assert (name, block) == ("trial_start", "block=learning")
    assert levels == [f"{plain(key)}={plain(value)}" for key, value in condition.items()]
    assert all(level.count("=") == 1 for level in levels)


EMITS = {"Event", "_note", "note", "write_event", "_write", "_say"}


def emitted() -> dict[str, str]:
    """Return every event that the sources name where they make one, and where that is."""
    found = {}
    sources = [path for top in ("labcrane", "plugins") for path in (ROOT / top).rglob("*.py")]
    for path in (path for path in sources if "templates" not in path.parts):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            name = getattr(node.args[0], "value", None)
            if called in EMITS and re.fullmatch(r"[a-z_]+\.[a-z_]+", str(name)):
                found[name] = f"{path.relative_to(ROOT)}:{node.lineno}"
    return found


def test_every_event_that_is_made_has_its_row() -> None:
    made = emitted()
    assert len(made) > 40
    assert {name: where for name, where in made.items() if name not in KINDS} == {}
    assert {f"order.{order}" for order in Order} <= set(KINDS)


def test_a_code_is_of_one_event_and_a_pulse_is_of_what_is_learnt_at_once() -> None:
    assert len(set(CODES.values())) == len(CODES)
    assert len({kind.label for kind in KINDS.values()}) == len(KINDS)
    assert all(OTHER < code < 256 for code in CODES.values())
    assert set(CODES) - set(PULSES) == {"movement.onset", "movement.offset"}
