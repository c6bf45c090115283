"""What people write enters by its limits, and nothing that they write can raise in the loop."""

import json
import random
import re
import time

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rehearsal import SHORT, a_study, rehearse

from labcrane.core import AnswerError, Item
from labcrane.limits import LIMITS, LimitError, check_text, read_json
from labcrane.participants.personal_data import personal
from labcrane.session.commands import KINDS, beyond_limits
from labcrane.session.questionnaire import QuestionnaireForm
from labcrane.testing import Command, Order, QueueConsole, Study

QUESTIONS = """\
questionnaires:
  words: {use: free, title: Words, questions: [{name: said, text: What?, kind: text}]}
sessions:
  - name: only
    steps:
      - questionnaire: [subjective_accuracy, words]
"""

PEOPLE = sorted(set(Order) - {Order.END, Order.SUBMIT})

HOSTILE = [
    "[" * 100_000,
    "9" * 6000,
    '{"questionnaire": "subjective_accuracy", "item": "rating", "value": ' + "9" * 6000 + "}",
    '{"questionnaire": "subjective_accuracy", "item": "rating", "value": NaN}',
    '{"questionnaire": "subjective_accuracy", "item": "rating", "value": 1e999}',
    '{"questionnaire": "subjective_accuracy", "item": {"a": []}, "value": 1}',
    '{"questionnaire": "words", "item": "said", "value": "\\ud800"}',
    '{"questionnaire": "words", "item": "said", "value": "\ud800"}',
    '"' + "\\" * 3999,
    "a@" * 4000,
    "@" * 8000,
    "tone.far=" + "[" * 190,
    "tone.far=2001-99-99",
    "tone.far=&a [*a, *a]",
    "\x00\x1b[2J",
    "\u202eesrever",
]
"""What was found to break something, and its relatives."""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    head = SHORT.partition("sessions:")[0]
    return a_study(tmp_path_factory.mktemp("study"), head + QUESTIONS)


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: ascii(text[:30]))
@pytest.mark.parametrize("order", PEOPLE)
def test_no_words_can_raise_in_the_loop(study: Study, order: Order, text: str) -> None:
    script = {2: [Command(order, text, "participant")], 4: [Command(Order.END)]}
    seen = rehearse(study, script, waits=True)
    assert seen.events("session.end")[0].data["reason"] == "by order"


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PEOPLE), st.text(max_size=300)), max_size=12))
def test_no_sequence_of_orders_with_any_words_raises_in_the_loop(
    study: Study, orders: list[tuple[Order, str]]
) -> None:
    script = {2: [Command(*each, by="participant") for each in orders], 4: [Command(Order.END)]}
    seen = rehearse(study, script, waits=True)
    text = json.dumps([dict(frame_event.data) for frame_event in seen.events("session.end")])
    assert "by order" in text


def test_an_answer_beyond_the_limits_is_refused_without_being_kept(study: Study) -> None:
    script = {2: [Command(Order.ANSWER, "[" * 100_000, "participant")], 4: [Command(Order.END)]}
    [refused] = rehearse(study, script, waits=True).events("questionnaire.refused")
    assert refused.data["why"] == "the answer has 100000 characters; the maximum is 8000"
    assert refused.data["given"] == ""


@given(st.recursive(st.none(), lambda inner: st.lists(inner, max_size=2), max_leaves=30))
def test_json_is_read_exactly_when_it_is_flat_enough(value: object) -> None:
    def depth(node: object) -> int:
        return 1 + max(map(depth, node), default=0) if isinstance(node, list) else 0

    text = json.dumps(value)
    if depth(value) <= LIMITS["answer"].depth:
        assert read_json(text, "answer") == value
    else:
        with pytest.raises(LimitError, match="nested deeper than 4 levels; write it flat"):
            read_json(text, "answer")


@given(st.text(alphabet='[]{}"\\a', max_size=60))
def test_brackets_inside_a_text_are_no_depth(words: str) -> None:
    assert read_json(json.dumps([words]), "answer") == [words]


def test_words_that_no_page_can_show_are_no_answer() -> None:
    item = Item("said", "What?", "text")
    with pytest.raises(AnswerError, match=re.escape("contains the character U+D800")):
        item.check("half \ud800")
    words = "„Grüße“ 👋🏽 日本語\n\t\u05e9\u05dc\u05d5\u05dd"
    assert item.check(words) == words


@given(st.sampled_from(sorted(KINDS)), st.integers(min_value=1, max_value=40))
def test_each_kind_of_words_may_be_as_long_as_the_table_says_and_no_longer(
    order: Order, more: int
) -> None:
    most = LIMITS[KINDS[order]].most
    assert beyond_limits(Command(order, "a" * most)) is None
    assert f"has {most + more} characters; the maximum is {most}" in str(
        beyond_limits(Command(order, "a" * (most + more)))
    )


def test_what_is_beyond_the_limits_is_refused_before_it_reaches_a_pipe() -> None:
    console = QueueConsole()
    console.give(Command(Order.NOTE, "x" * 20_000_000, "supervisor", "10.0.0.7"))
    assert console.commands() == [
        Command(
            Order.DENIED,
            "note: the note has 20000000 characters; the maximum is 4000",
            "supervisor",
            "10.0.0.7",
        )
    ]


OLD_MAIL = re.compile(r"\S+@\S+\.\w{2,}")


@settings(max_examples=400)
@given(st.text(alphabet="a@. -ü1\n", max_size=24))
@example("@a.bc")
@example("a@@.bc")
@example("a@.bc")
def test_a_mail_address_is_what_stands_around_an_at(text: str) -> None:
    """The pattern says what is meant; it needs time that grows with the square of the text."""
    assert (personal(text) == "an e-mail address") == bool(OLD_MAIL.search(text))


def _work(text: str) -> float:
    best = float("inf")
    for _ in range(5):
        before = time.thread_time()
        personal(text)
        best = min(best, time.thread_time() - before)
    return best


@pytest.mark.parametrize(
    "piece", ["a", "@", "a@", "a.", "1", "1.1", "1-", "+(", "@a.", " 1", "-1."]
)
def test_looking_for_persons_takes_time_that_grows_no_faster_than_the_text(piece: str) -> None:
    """Ratio of CPU times for sixteen times the text: 16 where it is linear, 256 where square."""
    once = _work(piece * 4000)
    assert _work(piece * 64_000) < 64 * max(once, 2e-5)


def test_any_bytes_as_an_answer_leave_a_questionnaire_that_can_be_handed_in(study: Study) -> None:
    dice = random.Random(7)
    form = QuestionnaireForm("subjective_accuracy", study.questionnaires["subjective_accuracy"], {})
    for _ in range(2000):
        raw = bytes(dice.choices(b'{}[]":,0123456789eE+-.\\u itemvalueques', k=dice.randint(0, 80)))
        name, _ = form.take(raw.decode(), "participant")
        assert name == "questionnaire.refused"
    good = {"questionnaire": "subjective_accuracy", "item": "rating", "value": 7}
    form.take(json.dumps(good), "participant")
    assert form.hand_in("participant")[1]["handed_in"]


@given(st.text(max_size=50))
def test_words_are_refused_only_for_a_reason_that_names_the_character(text: str) -> None:
    try:
        check_text(text, "note")
    except LimitError as error:
        [code] = re.findall(r"U\+([0-9A-F]{4})", str(error))
        assert chr(int(code, 16)) in text
    else:
        text.encode()


def test_every_order_of_people_has_a_limit() -> None:
    assert set(KINDS.values()) | {"order"} <= set(LIMITS)
