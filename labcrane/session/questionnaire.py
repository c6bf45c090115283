"""Questionnaires asked in a session: answers as they come, and stop rules after them."""

import json
import math
import random
import re
from collections.abc import Iterator, Mapping

from labcrane.core.items import AnswerError, Item, shuffled
from labcrane.core.records import Trial, Value
from labcrane.core.roles import Questionnaire
from labcrane.design.plan import SessionPlan
from labcrane.design.seeds import derive
from labcrane.limits import LimitError, read_json
from labcrane.participants.personal_data import personal
from labcrane.protocol.study import Study
from labcrane.recording.participant_file.questionnaires import ANSWER, END, SCORE
from labcrane.session.commands import AnswerGiven, Submission
from labcrane.session.stop_rules import Said, after_questionnaire

SIMULATION = "simulation"
"""Who answers for a simulated participant."""

START, REFUSED = "questionnaire.start", "questionnaire.refused"

ANSWER_KIND = "answer"
UNREAD = "unread"
"""Item of an answer that was refused before it was read: beyond the limits, or no JSON."""


class QuestionnaireForm:
    """Takes answers one by one; each becomes an event at once.

    Parameters
    ----------
    name
        The study's name for the questionnaire.
    about
        Where in the session it is asked: step, and trial if it follows one.
    answered
        What was answered before the session stopped.
    seed
        From which the order of its cards is drawn, and which of them are turned.

    Attributes
    ----------
    over
        Whether it has been submitted.
    """

    def __init__(
        self,
        name: str,
        questionnaire: Questionnaire,
        about: Mapping[str, Value],
        answered: Mapping[str, Value] | None = None,
        seed: int = 0,
    ) -> None:
        self.over = False
        self._questionnaire = questionnaire
        self._items = {item.name: item for item in questionnaire.items()}
        self._seed = seed
        self._about = {"questionnaire": name, **about}
        self._answers: dict[str, Value] = dict(answered or {})

    def begin(self) -> Said:
        """Return the event with which it begins."""
        kept = json.dumps(self._answers, ensure_ascii=False)
        about = {**self._about, "title": self._questionnaire.title, "kept": kept}
        items = list(self._items.values())
        if any(item.card for item in items):  # pages follow the order in the record
            shown = shuffled(items, self._seed)
            about["order"] = " ".join(item.name for item in shown)
            about["turned"] = " ".join(item.name for item in shown if item not in items)
        return START, about

    def take(self, text: str, by: str) -> Said:
        """Take an answer, as JSON of questionnaire, item and value; return what is to be said."""
        data: dict[str, Value] = {**self._about, "by": by}
        try:
            given = read_json(text, ANSWER_KIND)
            item, value = self._find(given)
            answer = item.check(value)
            if isinstance(answer, str) and (found := personal(answer)):
                # What names a person must not be in the record, not even as a refused answer.
                why = f"an answer must not contain {found}; remove it"
                return REFUSED, {**data, "given": "", "item": item.name, "why": why}
        except LimitError as error:
            # Nor what no page could show.
            return REFUSED, {**data, "given": "", "item": UNREAD, "why": str(error)}
        except AnswerError as error:
            return REFUSED, {**data, "given": text, "item": _item_of(text), "why": str(error)}
        self._answers[item.name] = answer
        return ANSWER, {**data, "item": item.name, "value": answer}

    def hand_in(self, by: str) -> Said:
        """Hand it in; refused while a required question is neither answered nor declined."""
        open_items = [
            item.name
            for item in self._items.values()
            if item.required and item.name not in self._answers
        ]
        if open_items:
            why = f"{', '.join(open_items)} have no answer; answer or decline them"
            return REFUSED, {**self._about, "by": by, "given": "", "item": "", "why": why}
        self.over = True
        return self._end(by, handed_in=True, done=True)

    def leave(self, *, done: bool) -> Said:
        """Return the event with which it ends without being submitted.

        ``done`` is whether it need not be asked again.
        """
        self.over = True
        return self._end("", handed_in=False, done=done)

    def scores(self) -> dict[str, float]:
        """Return every score; NaN where it needs an answer that is missing."""
        return dict(self._questionnaire.score(self._answers))

    def simulated(self, seed: int, known: Mapping[str, Value]) -> Iterator[Said]:
        """Yield simulated answers: the known ones, the rest at random; then submit."""
        dice = random.Random(seed)  # noqa: S311 - nothing secret
        for item in self._items.values():
            drawn = _any(item, dice)  # always, so that one that is known does not change the others
            value = known.get(item.name, drawn)
            answer = json.dumps({**self._about, "item": item.name, "value": value})
            yield self.take(answer, SIMULATION)
        yield self.hand_in(SIMULATION)

    def _end(self, by: str, *, handed_in: bool, done: bool) -> Said:
        missing = sum(self._answers.get(name) is None for name in self._items)
        scores: dict[str, Value] = {
            f"{SCORE}{name}": None if math.isnan(value) else value
            for name, value in self.scores().items()
        }
        return END, {
            **self._about,
            "by": by,
            "handed_in": handed_in,
            "done": done,
            "missing": missing,
            **scores,
        }

    def _find(self, given: object) -> tuple[Item, object]:
        name = self._about["questionnaire"]
        if (
            not isinstance(given, dict)
            or given.get("questionnaire") != name
            or "value" not in given
        ):
            raise AnswerError(
                f"an answer needs questionnaire {name!r}, item and value, not {given!r}"
            )
        item = self._items.get(str(given.get("item")))
        if item is None:
            known = ", ".join(self._items)
            raise AnswerError(f"{name} has no item {given.get('item')!r}; it has {known}")
        return item, given["value"]


def _item_of(text: str) -> str:
    """Return which item an answer that is refused was for; empty when it names none."""
    found = re.search(r'"item": ?"([a-z][a-z0-9_]*)"', text)
    return found[1] if found else ""


def _any(item: Item, dice: random.Random) -> Value:
    if item.kind == "choice":
        return dice.choice(item.choices)
    if item.kind == "text":
        return "simulated"
    if item.step:
        return item.at_step(dice.randint(0, item.steps))
    return item.lowest + (item.highest - item.lowest) / 10.0 * dice.randint(0, 10)


class QuestionnaireRun:
    """Asks one questionnaire and looks at the study's stop rules.

    Parameters
    ----------
    answered
        What was answered before the session stopped.
    after
        The trial it follows; None when it is a step of its own.
    """

    def __init__(
        self,
        study: Study,
        plan: SessionPlan,
        name: str,
        step: int,
        answered: Mapping[str, Value],
        after: Trial | None,
    ) -> None:
        about: dict[str, Value] = {"step": step}
        if after is not None:
            about["trial"] = after.number
        self._name = name
        self._rules = study.protocol.stop_rules
        # The first session keeps the draws of recordings in which all sessions had the same ones.
        later = (plan.number,) if plan.number > 1 else ()
        drawn = (after.seed if after else plan.seed, step, name, *(() if after else later))
        self._seed = derive("answers", *drawn)
        asked = study.questionnaires[name]
        self._form = QuestionnaireForm(name, asked, about, answered, derive("cards", *drawn))
        self._known = study.answers.get(name, {})

    @property
    def over(self) -> bool:
        """Whether it has been submitted."""
        return self._form.over

    def begin(self, *, simulated: bool) -> Iterator[Said]:
        """Yield what is said at its beginning, and a simulated participant's answers."""
        yield self._form.begin()
        if simulated:
            yield from self._form.simulated(self._seed, self._known)

    def handle(self, request: AnswerGiven | Submission, about: Mapping[str, Value]) -> Said:
        """Take an answer, or submit the questionnaire; return the events about it.

        ``about`` is by whom it was given, and from which address.
        """
        by = str(about["by"])
        if isinstance(request, AnswerGiven):
            name, data = self._form.take(request.text, by)
        else:
            name, data = self._form.hand_in(by)
        return name, {**data, **about}

    def end(self, *, skipped: bool) -> Iterator[Said]:
        """Yield what is said at its end: that it was left, and the stop rules that it meets.

        One that was left but not skipped remains to be done: the session has ended.
        """
        if not self.over:
            yield self._form.leave(done=skipped)
        yield from after_questionnaire(self._rules, self._name, self._form.scores())
