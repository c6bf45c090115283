"""Items of a questionnaire, and their possible answers."""

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Literal

from labcrane.core.records import Value
from labcrane.limits import LimitError, check_text

Kind = Literal["scale", "number", "choice", "text"]

STEP_TOLERANCE = 1e-9


class AnswerError(ValueError):
    """An item does not accept an answer; the message states which answers it accepts."""


@dataclass(frozen=True, slots=True)
class Item:
    """One item.

    Attributes
    ----------
    name
        A lower-case word; names the answer in the record.
    text
        Its wording, in the language of the questionnaire.
    kind
        ``scale``: a number on steps between ``lowest`` and ``highest``; ``number``: any number
        between them; ``choice``: one of ``choices``; ``text``: words.
    lowest, highest, step
        Of a scale or number, in the unit that ``text`` asks for; a step of 0 allows every answer
        between.
    left, right
        Words at the ends of a scale.
    choices, labels
        Of a choice: the recorded values, and the text shown for each; the same by default.
    words
        Of a scale: numbers, and the words shown at each.
    numbered
        Whether a scale shows its numbers.
    card
        Whether it is one of the items that are presented in random order.
    required
        Whether the questionnaire can be submitted only after this is answered or declined.
    turned
        Of a card with choices: its wording with the choices in reverse order, which is random
        too; empty if their order is fixed.
    """

    name: str
    text: str
    kind: Kind = "scale"
    lowest: float = 0.0
    highest: float = 10.0
    step: float = 1.0
    left: str = ""
    right: str = ""
    choices: tuple[str, ...] = ()
    required: bool = True
    labels: tuple[str, ...] = ()
    words: tuple[tuple[float, str], ...] = ()
    numbered: bool = True
    card: bool = False
    turned: str = ""

    @property
    def takes(self) -> str:
        """The possible answers, in words."""
        if self.kind == "choice":
            return f"one of {', '.join(self.choices)}"
        if self.kind == "text":
            return "words"
        span = f"{self.lowest:g} to {self.highest:g}"
        if self.step:
            span += f" in steps of {self.step:g}"
        return f"{span}: {self.meanings}" if self.meanings else span

    @property
    def steps(self) -> int:
        """Number of steps from the lowest answer to the highest; 0 where ``step`` is 0."""
        if not self.step:
            return 0
        return math.floor((self.highest - self.lowest) / self.step + STEP_TOLERANCE)

    def at_step(self, number: int) -> float:
        """Return the answer at a step, counted from 0 at the lowest.

        Computed in decimals, as people write it: 3 steps of 0.1 from 0 are 0.3.
        """
        lowest, step = (Decimal(repr(float(each))) for each in (self.lowest, self.step))
        # A step written as 0.3333333334 leads beyond a highest of 1 by less than the tolerance.
        return min(float(lowest + number * step), float(self.highest))

    def nearest(self, number: float) -> float:
        """Return the answer at the step nearest to a number; the number where ``step`` is 0."""
        if not self.step:
            return number
        return self.at_step(round((number - self.lowest) / self.step))

    @property
    def worded(self) -> Mapping[float, str]:
        """The words of the answers that have some."""
        return {self.nearest(at): words for at, words in self.words}

    @property
    def meanings(self) -> str:
        """What answers of a scale mean, its ends among them: ``0 Good, 100 Poor``."""
        ends = {self.lowest: self.left, self.highest: self.right}
        said = sorted((ends | dict(self.worded)).items())
        return ", ".join(f"{at:g} {words}" for at, words in said if words)

    def check(self, answer: object) -> Value:
        """Return an answer as it is recorded, a number as its step; None declines the item.

        Raises
        ------
        AnswerError
            The item does not accept it.
        """
        if answer is None:
            return None
        if self.kind in {"choice", "text"}:
            fits = isinstance(answer, str) and bool(answer.strip())
            if fits and (self.kind == "text" or answer in self.choices):
                return _written(str(answer))
        elif _is_number(answer) and self._on_scale(float(str(answer))):
            return self.nearest(float(str(answer)))
        raise AnswerError(f"item {self.name!r} takes {self.takes}, not {answer!r}")

    def _on_scale(self, number: float) -> bool:
        if not self.lowest <= number <= self.highest:  # also refuses NaN
            return False
        if not self.step:
            return True
        steps = (number - self.lowest) / self.step
        return math.isclose(steps, round(steps), abs_tol=STEP_TOLERANCE)


@dataclass(frozen=True, slots=True)
class Score:
    """A number computed from answers.

    Attributes
    ----------
    name
        A lower-case word; names the score in the record.
    lowest, highest
        The range of the score.
    """

    name: str
    lowest: float
    highest: float


def shuffled(items: Sequence[Item], seed: int) -> list[Item]:
    """Return items with the cards among them in random order; the others keep their places.

    Each card that can be turned is turned at random.
    """
    cards = [item for item in items if item.card]
    dice = random.Random(seed)  # noqa: S311 - nothing secret
    dice.shuffle(cards)
    drawn = iter(
        [_turned(card) if card.turned and dice.random() < 1 / 2 else card for card in cards]
    )
    return [next(drawn) if item.card else item for item in items]


def in_order(items: Sequence[Item], order: str, turned: str = "") -> Sequence[Item]:
    """Return items as they are shown according to the record.

    They are in the order of their names in ``order``, unchanged if it is empty; those named in
    ``turned`` have their choices in reverse order.
    """
    names, round_ = order.split(), turned.split()
    shown = [_turned(item) if item.name in round_ else item for item in items]
    return sorted(shown, key=lambda item: names.index(item.name)) if names else shown


def _turned(card: Item) -> Item:
    return replace(
        card,
        text=card.turned,
        turned=card.text,
        choices=card.choices[::-1],
        labels=card.labels[::-1],
    )


def _written(answer: str) -> str:
    """Return a text unchanged; JSON can contain lone surrogates, which no page can show."""
    try:
        check_text(answer, "answer")
    except LimitError as error:
        raise AnswerError(str(error)) from None
    return answer


def _is_number(answer: object) -> bool:
    return isinstance(answer, int | float) and not isinstance(answer, bool)


Answers = Mapping[str, Value]
"""Answers by the items' names; a declined or unanswered item is None, or missing."""


def numeric_answers(answers: Answers, names: Sequence[str]) -> list[float]:
    """Return the named answers as numbers, NaN for those that are missing.

    Nothing is imputed: a sum with a missing answer is NaN.
    """
    values = (answers.get(name) for name in names)
    return [float(str(value)) if _is_number(value) else math.nan for value in values]
