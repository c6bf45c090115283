"""Scores against published definitions, worked by hand; items, languages and rights."""

import json
import math
from pathlib import Path

import pytest
from pydantic import ValidationError
from rehearsal import SHORT, ScriptedConsole, a_study

from labcrane import ProtocolError, Questionnaire
from labcrane.cli.questionnaire import Sheets
from labcrane.core import AnswerError, Event, Item
from labcrane.core.items import in_order
from labcrane.protocol.questions import questions
from labcrane.replay import replay_session
from labcrane.session.questionnaire import QuestionnaireForm
from labcrane.testing import QuestionnaireContract, Visit, run
from labcrane.web.form import _label
from labcrane_questionnaires.demographics import Demographics
from labcrane_questionnaires.free import Free
from labcrane_questionnaires.licensed_scales import SLOTS
from labcrane_questionnaires.rating import Rating
from labcrane_questionnaires.sart import Sart
from labcrane_questionnaires.settings import (
    DemographicsSettings,
    FreeSettings,
    LabText,
    RatingSettings,
    SusSettings,
    TlxSettings,
)
from labcrane_questionnaires.ssq import Ssq
from labcrane_questionnaires.sus import NAMES, Sus
from labcrane_questionnaires.tlx import NAMES as SCALES
from labcrane_questionnaires.tlx import PAIRS, NasaTlx


def a_lab_text(items: int) -> LabText:
    return LabText(rights="a licence", items=tuple(f"words {n}" for n in range(items)))


BUILT = {
    "nasa_tlx": NasaTlx(TlxSettings()),
    "tlx weighted": NasaTlx(TlxSettings(weighted=True)),
    "sus": Sus(SusSettings()),
    "ssq": Ssq(a_lab_text(16)),
    "sart": Sart(a_lab_text(10)),
    "subjective_accuracy": Rating("subjective_accuracy", RatingSettings()),
    "situational_awareness": Rating("situational_awareness", RatingSettings(language="de")),
    "demographics": Demographics(DemographicsSettings()),
    "free": Free(
        FreeSettings.model_validate(
            {
                "title": "Comfort",
                "questions": [
                    {"name": "heat", "text": "Too hot?"},
                    {"name": "why", "text": "Why?", "kind": "text"},
                ],
                "sums": {"discomfort": ["heat"]},
            }
        )
    ),
    **{name: SLOTS[name](a_lab_text(1)) for name in ("borg_cr10", "borg_rpe", "kss")},
}


class TestBundled(QuestionnaireContract):
    @pytest.fixture(params=BUILT)
    def questionnaire(self, request: pytest.FixtureRequest) -> Questionnaire:
        return BUILT[request.param]


RATINGS = dict(zip(SCALES, (70.0, 30.0, 55.0, 20.0, 65.0, 40.0), strict=True))


def test_demographics_ask_what_the_study_says_in_its_order() -> None:
    asked = Demographics(DemographicsSettings(ask=("gender", "age"), language="de")).items()
    assert [(item.name, item.labels[:2]) for item in asked] == [
        ("gender", ("weiblich", "männlich")),
        ("age", ()),
    ]
    with pytest.raises(ValidationError, match="'age' is listed twice; write each once"):
        DemographicsSettings(ask=("age", "age"))


def test_weighted_tlx_is_the_tally_weighted_sum_over_fifteen() -> None:
    # Mental wins all its five pairs, effort four, temporal three, frustration two, physical one.
    rank = ("mental", "effort", "temporal", "frustration", "physical", "performance")
    chosen = {f"{a}_or_{b}": min(a, b, key=rank.index) for a, b in PAIRS}
    by_hand = (5 * 70 + 4 * 65 + 3 * 55 + 2 * 40 + 1 * 30 + 0 * 20) / 15
    scores = BUILT["tlx weighted"].score({**RATINGS, **chosen})
    assert scores["weighted"] == pytest.approx(by_hand)
    assert len(PAIRS) == 15


def test_performance_runs_from_good_to_poor_and_is_not_turned_round() -> None:
    item = next(i for i in BUILT["nasa_tlx"].items() if i.name == "performance")
    assert (item.left, item.right) == ("Good", "Poor")
    assert BUILT["nasa_tlx"].score({**RATINGS, "performance": 80.0})["raw"] == pytest.approx(
        340 / 6
    )


@pytest.mark.parametrize(
    ("answers", "total"),
    [
        ([3] * 10, 50.0),
        ([5, 1] * 5, 100.0),
        ([1, 5] * 5, 0.0),
        ([4, 2, 5, 1, 4, 3, 5, 2, 4, 2], 80.0),  # (3+4+3+4+3) + (3+4+2+3+3) = 32
    ],
)
def test_sus_turns_even_statements_round(answers: list[int], total: float) -> None:
    given = dict(zip(NAMES, map(float, answers), strict=True))
    assert BUILT["sus"].score(given) == {"total": total}


def symptoms(*numbers: int, of: float = 3.0) -> dict[str, float]:
    return {f"symptom_{n}": of if n in numbers else 0.0 for n in range(1, 17)}


def test_ssq_at_its_worst_is_what_kennedys_weights_allow() -> None:
    scores = BUILT["ssq"].score(symptoms(*range(1, 17)))
    assert {name: round(value, 2) for name, value in scores.items()} == {
        "nausea": 200.34,
        "oculomotor": 159.18,
        "disorientation": 292.32,
        "total": 235.62,
    }


def test_ssq_counts_item_8_in_nausea_and_in_disorientation() -> None:
    scores = BUILT["ssq"].score(symptoms(8, of=1.0))
    assert scores == {
        "nausea": 9.54,
        "oculomotor": 0.0,
        "disorientation": 13.92,
        "total": pytest.approx(2 * 3.74),
    }


def test_sart_is_understanding_less_the_surplus_of_demand() -> None:
    names = [item.name for item in BUILT["sart"].items()]
    answers = dict(zip(names, map(float, (5, 6, 4, 5, 6, 4, 3, 5, 6, 4)), strict=True))
    assert BUILT["sart"].score(answers)["total"] == 15 - (15 - 18)
    worst, best = ([7.0] * 3 + [1.0] * 7), ([1.0] * 3 + [7.0] * 7)
    assert BUILT["sart"].score(dict(zip(names, worst, strict=True)))["total"] == -14
    assert BUILT["sart"].score(dict(zip(names, best, strict=True)))["total"] == 46


def test_a_missing_answer_leaves_only_the_scores_that_do_not_need_it() -> None:
    scores = BUILT["ssq"].score({**symptoms(3), "symptom_16": None})  # item 16 is of nausea only
    assert math.isnan(scores["nausea"])
    assert math.isnan(scores["total"])
    assert scores["oculomotor"] == pytest.approx(3 * 7.58)
    assert scores["disorientation"] == 0.0


@pytest.mark.parametrize("answer", [103.0, -5.0, 52.0, float("nan"), "70", True])
def test_an_answer_off_the_scale_is_refused_with_what_is_possible(answer: object) -> None:
    item = BUILT["nasa_tlx"].items()[0]
    with pytest.raises(
        AnswerError, match=r"item 'mental' takes 0 to 100 in steps of 5: 0 Low, 100 High, not "
    ):
        item.check(answer)


def test_a_choice_takes_its_choices_only() -> None:
    item = Item("hand", "Which?", "choice", choices=("left", "right"))
    assert item.check("left") == "left"
    assert item.check(None) is None
    with pytest.raises(AnswerError, match="item 'hand' takes one of left, right, not 'up'"):
        item.check("up")


def a_protocol(steps: str, more: str = "") -> str:
    head = SHORT.partition("sessions:")[0]
    return f"{head}{more}sessions:\n  - name: only\n    steps:\n{steps}"


def refusal(folder: Path, steps: str, more: str = "") -> str:
    with pytest.raises(ProtocolError) as caught:
        a_study(folder, a_protocol(steps, more))
    return str(caught.value)


def test_text_that_may_not_be_shipped_is_asked_of_the_lab(tmp_path: Path) -> None:
    assert "name the lab's own file with file:" in refusal(tmp_path, "      - questionnaire: ssq\n")
    more = "questionnaires: {ssq: {use: ssq, file: ssq.yaml}}\n"
    step = "      - questionnaire: ssq\n"
    assert "ssq.yaml' cannot be read" in refusal(tmp_path, step, more)
    (tmp_path / "ssq.yaml").write_text("rights: bought\nitems: [one, two]\n", encoding="utf-8")
    said = refusal(tmp_path, step, more)
    assert "Simulator sickness questionnaire has 16 items, and the lab's file has 2" in said
    (tmp_path / "ssq.yaml").write_text(
        f"rights: bought\nitems: {[f'w{n}' for n in range(16)]}\n", encoding="utf-8"
    )
    study = a_study(tmp_path, a_protocol(step, more))
    assert study.questionnaires["ssq"].items()[15].text == "w15"
    assert study.questionnaires["ssq"].rights == "bought"


def test_a_stop_rule_needs_a_score_that_there_is(tmp_path: Path) -> None:
    more = "stop_rules: [{questionnaire: sus, score: sum, above: 3}]\n"
    said = refusal(tmp_path, "      - questionnaire: sus\n", more)
    assert "sus has no score 'sum'; it has total" in said


def test_weights_that_mean_nothing_are_refused(tmp_path: Path) -> None:
    zero = "duration: 0, object: 0, body: 0, overload_max: 0, overload_min: 0"
    more = f"indicator: {{weights: {{{zero}, accuracy: 0, awareness: 0}}}}\n"
    said = refusal(tmp_path, "      - questionnaire: sus\n", more)
    assert "indicator.weights: all weights are 0; at least one must be above 0" in said


COMFORT = {"title": "Comfort", "questions": [{"name": "heat", "text": "Too hot?"}]}
ASK_COMFORT = "      - questionnaire: comfort\n"
BY_FILE = "questionnaires: {comfort: {use: free, file: comfort.yaml}}\n"


def test_the_labs_own_questions_may_stand_in_a_file_of_their_own(tmp_path: Path) -> None:
    file = tmp_path / "comfort.yaml"
    file.write_text(json.dumps(COMFORT), encoding="utf-8")
    study = a_study(tmp_path, a_protocol(ASK_COMFORT, BY_FILE))
    assert [item.text for item in study.questionnaires["comfort"].items()] == ["Too hot?"]
    twice = BY_FILE.replace("comfort.yaml", "comfort.yaml, title: Warmth")
    assert "title is in both 'comfort.yaml' and" in refusal(tmp_path, ASK_COMFORT, twice)
    file.write_text("Too hot?", encoding="utf-8")
    assert "holds no keys; it must hold title and questions" in refusal(
        tmp_path, ASK_COMFORT, BY_FILE
    )
    file.unlink()
    assert "comfort.yaml' cannot be read" in refusal(tmp_path, ASK_COMFORT, BY_FILE)


def test_a_session_is_replayed_without_the_file_of_its_questions(tmp_path: Path) -> None:
    file = tmp_path / "comfort.yaml"
    file.write_text(json.dumps(COMFORT), encoding="utf-8")
    study = a_study(tmp_path, a_protocol(ASK_COMFORT, BY_FILE))
    path = run(
        Visit(study, "P001", 1, tmp_path / "data", simulated=True, fast=True), ScriptedConsole()
    )
    file.unlink()
    assert replay_session(path, 1).difference is None


WORDED = (
    "rights: a licence\nitems: [How sleepy?]\nwords: {1: wide awake, 5: neither, 9: fighting it}\n"
)


def from_file(folder: Path, use: str, words: str, **settings: object) -> Questionnaire:
    """Build one as a study with the lab's file does."""
    (folder / "words.yaml").write_text(words)
    more = "".join(f", {key}: {json.dumps(value)}" for key, value in settings.items())
    asked = f"questionnaires: {{q: {{use: {use}, file: words.yaml{more}}}}}\nsessions:"
    steps = "    steps:\n      - questionnaire: q"
    text = SHORT.replace("sessions:", asked).replace("    steps:", steps)
    return a_study(folder, text).questionnaires["q"]


def test_the_words_of_the_publication_stand_at_their_steps(tmp_path: Path) -> None:
    (item,) = from_file(tmp_path, "kss", WORDED).items()
    assert item.words == ((1.0, "wide awake"), (5.0, "neither"), (9.0, "fighting it"))
    assert item.takes == "1 to 9 in steps of 1: 1 wide awake, 5 neither, 9 fighting it"


@pytest.mark.parametrize(
    ("words", "said"),
    [("words: {1: awake, 10: asleep}", "Karolinska sleepiness scale has words at 10, and takes 1"),
     ("words: {1.5: awake}", "has words at 1.5, and takes 1 to 9 in steps of 1")],
)  # fmt: skip
def test_words_at_no_step_are_refused(tmp_path: Path, words: str, said: str) -> None:
    with pytest.raises(ProtocolError, match=said):
        from_file(tmp_path, "kss", f"rights: x\nitems: [How sleepy?]\n{words}\n")
    question = {"name": "a", "text": "A", "words": {0: "never", 11: "always"}}
    with pytest.raises(ValidationError, match="'a' has words at 11, and takes 0 to 10"):
        FreeSettings.model_validate({"title": "T", "questions": [question]})
    with pytest.raises(ValidationError, match="'a' has words, but is not a scale"):
        FreeSettings.model_validate({"title": "T", "questions": [{**question, "kind": "text"}]})


@pytest.mark.parametrize("use", ["ssq", "kss", "borg_cr10", "borg_rpe", "sart"])
def test_a_scale_that_is_published_with_words_is_asked_about_without_them(
    tmp_path: Path, use: str
) -> None:
    items = [f"w{n}" for n in range({"ssq": 16, "sart": 10}.get(use, 1))]
    more = f"questionnaires: {{q: {{use: {use}, file: q.yaml}}}}\n"
    protocol = a_protocol("      - questionnaire: q\n", more)
    asked = []
    step = 7 if use == "borg_rpe" else 3
    for words in ("", f"words: {{{step}: at this step}}\n"):
        (tmp_path / "q.yaml").write_text(f"rights: x\nitems: {items}\n{words}")
        found = questions(a_study(tmp_path, protocol))
        asked.append([each for each in found if "questionnaires" in each.key])
    if use == "sart":
        assert asked == [[], []]
        return
    ((question,), worded) = asked
    assert question.key == "questionnaires.q.file"
    assert "so that what is asked is not the published instrument; write them" in question.text
    assert not worded


def test_words_at_tenths_stand_on_the_page_and_answers_are_the_numbers_that_were_written() -> None:
    words = {0: "never", 0.3: "seldom", 0.6: "often", 0.7: "mostly", 1: "always"}
    question = {"name": "a", "text": "A", "highest": 1, "step": 0.1, "words": words}
    settings = FreeSettings.model_validate({"title": "T", "questions": [question]})
    (item,) = Free(settings).items()
    shown = [item.at_step(number) for number in range(item.steps + 1)]
    assert shown == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    said = [_label(item, value) for value in shown]
    assert [each for each in said if " " in each] == [
        "0  never", "0.3  seldom", "0.6  often", "0.7  mostly", "1  always",
    ]  # fmt: skip
    assert item.check(0.1 * 3) == 0.3
    assert [item.check(value) for value in shown] == shown


def test_no_step_of_a_scale_lies_beyond_its_highest_answer() -> None:
    uneven = Item("a", "A", highest=11.0, step=4.0)
    assert [uneven.at_step(number) for number in range(uneven.steps + 1)] == [0.0, 4.0, 8.0]
    thirds = Item("a", "A", highest=1.0, step=0.3333333334)
    assert (thirds.steps, thirds.check(1.0), thirds.at_step(3)) == (3, 1.0, 1.0)


def test_cr10_takes_decimals_and_numbers_above_ten(tmp_path: Path) -> None:
    words = "rights: x\nitems: [How strong?]\nwords: {0: nothing, 0.3: a trace, 10: extreme}\n"
    scale = from_file(tmp_path, "borg_cr10", words)
    (item,) = scale.items()
    for rating in (0.0, 0.3, 2.8, 10.0, 12.5):
        assert scale.score({"rating": item.check(rating)})["rating"] == rating
    for wrong in (-0.1, 20.1):
        with pytest.raises(AnswerError, match=r"takes 0 to 20: 0 nothing, 0\.3 a trace"):
            item.check(wrong)


def test_the_load_index_defines_its_scales_whole_and_shows_no_numbers() -> None:
    items = NasaTlx(TlxSettings()).items()
    assert [item.text.partition(":")[0] for item in items] == [
        "Mental demand", "Physical demand", "Temporal demand", "Performance", "Effort",
        "Frustration level",
    ]  # fmt: skip
    assert "(e.g. thinking, deciding, calculating, remembering, looking" in items[0].text
    assert "(e.g. pushing, pulling, turning, controlling" in items[1].text
    assert not any(item.numbered for item in items)


def test_pairs_come_in_an_order_drawn_by_chance_that_is_recorded() -> None:
    tlx = NasaTlx(TlxSettings(weighted=True))
    plain = [item.name for item in tlx.items()]
    orders = []
    for seed in range(40):
        form = QuestionnaireForm("tlx", tlx, {"step": 1}, seed=seed)
        name, data = form.begin()
        order = str(data["order"]).split()
        assert name == "questionnaire.start"
        assert order[:6] == plain[:6], "ratings stay"
        assert sorted(order) == sorted(plain)
        assert [item.name for item in in_order(tlx.items(), str(data["order"]))] == order
        assert QuestionnaireForm("tlx", tlx, {"step": 1}, seed=seed).begin() == (name, data)
        orders.append(order)
    assert len({order[6] for order in orders}) > 8, "any of fifteen may be first"
    assert "order" not in QuestionnaireForm("sus", BUILT["sus"], {"step": 1}).begin()[1]


def test_which_title_of_a_pair_stands_left_is_drawn_by_chance_and_recorded() -> None:
    tlx = NasaTlx(TlxSettings(weighted=True))
    plain = {item.name: item for item in tlx.items()}
    lefts: dict[str, set[str]] = {}
    share = []
    for seed in range(40):
        _, data = QuestionnaireForm("tlx", tlx, {"step": 1}, seed=seed).begin()
        shown = in_order(tlx.items(), str(data["order"]), str(data["turned"]))
        sheet = Sheets({"tlx": tlx})(Event("questionnaire.start", 0.0, data), None)
        assert sheet.items() == shown, "the terminal shows what the page shows"
        assert shown[:6] == tlx.items()[:6], "ratings stay"
        share.append(len(str(data["turned"]).split()) / len(PAIRS))
        for card in shown[6:]:
            was = plain[card.name]
            assert sorted(card.choices) == sorted(was.choices)
            assert card.check(was.choices[0]) == was.choices[0]
            titles = dict(zip(was.choices, was.labels, strict=True))
            assert card.labels == tuple(titles[choice] for choice in card.choices)
            assert card.text.endswith(": {} or {}?".format(*card.labels))
            lefts.setdefault(card.name, set()).add(card.choices[0])
    assert all(lefts[f"{one}_or_{other}"] == {one, other} for one, other in PAIRS)
    assert 0.4 < sum(share) / len(share) < 0.6
    before = in_order(tlx.items(), " ".join(plain))
    assert before == list(plain.values()), "a record from before says nothing of sides"


GERMAN = """\
rights: our own translation
title: Belastung
items: ["A: a?", "B: b?", "C: c?", "D: d?", "E: e?", "F: f?"]
left: gering
right: hoch
performance: [gut, schlecht]
pair: "Was trug mehr bei: {one} oder {other}?"
"""


def test_the_load_index_and_sus_ask_in_the_language_of_the_labs_file(tmp_path: Path) -> None:
    tlx = from_file(tmp_path, "nasa_tlx", GERMAN, weighted=True)
    items = tlx.items()
    assert (tlx.title, tlx.rights, len(items)) == ("Belastung", "our own translation", 21)
    assert (items[3].text, items[3].left, items[3].right) == ("D: d?", "gut", "schlecht")
    assert items[6].text == "Was trug mehr bei: A oder B?"
    assert items[6].labels == ("A", "B")
    assert tlx.score(RATINGS | dict.fromkeys((f"{a}_or_{b}" for a, b in PAIRS), "effort")) == {
        "raw": pytest.approx(280 / 6), "weighted": pytest.approx(65.0),
    }  # fmt: skip
    statements = "items: [" + ", ".join(f"Satz {n}" for n in range(10)) + "]"
    sus = from_file(tmp_path, "sus", f"rights: x\n{statements}\nleft: nein\nright: ja\n")
    assert [item.text for item in sus.items()][9] == "Satz 9"
    with pytest.raises(ProtocolError, match="the six scales are needed"):
        from_file(tmp_path, "nasa_tlx", GERMAN.replace(', "F: f?"', ""))
    with pytest.raises(ProtocolError, match=r"must have .one. and .other."):
        from_file(tmp_path, "nasa_tlx", GERMAN.replace("{other}", "x"))
    with pytest.raises(ProtocolError, match="SUS has 10 statements, and the lab's file has 1"):
        from_file(tmp_path, "sus", "rights: x\nitems: [Satz]\n")


def test_words_at_no_step_of_sus_and_any_at_steps_of_the_load_index_are_refused(
    tmp_path: Path,
) -> None:
    statements = f"rights: x\nitems: {[f'Satz {n}' for n in range(10)]}\n"
    worded = from_file(tmp_path, "sus", f"{statements}words: {{1: nein, 5: ja}}\n")
    assert worded.items()[9].words == ((1.0, "nein"), (5.0, "ja"))
    with pytest.raises(
        ProtocolError,
        match=r"q\.file: SUS has words at 7, and takes 1 to 5 in steps of 1; write words at these",
    ):
        from_file(tmp_path, "sus", f"{statements}words: {{1: nein, 7: ja}}\n")
    with pytest.raises(
        ProtocolError,
        match="NASA task load index has words at 50, and its scales have words at their ends "
        "alone; write left, right and performance, and leave words out",
    ):
        from_file(tmp_path, "nasa_tlx", f"{GERMAN}words: {{50: mittel}}\n")
    was_run = {"recorded": True}
    text = {"rights": "x", "items": ("S",) * 10, "words": {7: "ja"}}
    assert SusSettings.model_validate({"text": text}, context=was_run).text.words == {7.0: "ja"}
