"""Design section of a protocol."""

from math import comb
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PositiveInt,
    ValidationInfo,
    field_validator,
)

from labcrane.core.settings import Settings
from labcrane.errors import meant
from labcrane.files.model import AtMost, Usual, was_run
from labcrane.files.names import MISSING
from labcrane.protocol.tracks import Track


def _is_no_missing_value(name: str, info: ValidationInfo) -> str:
    if name in MISSING and not was_run(info):
        raise ValueError(
            f"{name!r} means a missing value to pandas, R or BIDS, which would leave out all that "
            "is called so; take another name"
        )
    return name


FactorName = Annotated[str, AfterValidator(_is_no_missing_value)]
"""A name that is a value in tables: of a group, a condition, a task, a block or a session."""

RULES = ("as_written", "blocked", "latin_square", "shuffled", "williams")
"""Rules that a protocol may name under ``design: order:``; :mod:`labcrane.design.order` applies
them."""

LIMITED = frozenset({"shuffled", "blocked"})
"""Rules that take a limit of how often a level may come in a row."""

MOST_COUNTED = 200_000
"""Most states whose continuations are counted to draw an order: more take seconds, then hours."""


class LevelOrder(Settings):
    """Order of the levels of a factor."""

    rule: str
    """``as_written``; ``shuffled``: all repetitions together; ``blocked``: each repetition by
    itself; ``latin_square`` or ``williams``: each participant has a row of the square."""

    times: Annotated[PositiveInt, AtMost(1000)] = 1
    """How often each level occurs in a block."""

    in_a_row: Annotated[PositiveInt | None, Usual(1, 50)] = None
    """How often a level may occur in a row, where the order is random."""

    @field_validator("rule")
    @classmethod
    def _rule_exists(cls, rule: str) -> str:
        if rule not in RULES:
            raise ValueError(f"{rule!r} is not a rule; use one of {', '.join(RULES)}")
        return rule

    @field_validator("in_a_row")
    @classmethod
    def _something_is_random(cls, in_a_row: int | None, info: ValidationInfo) -> int | None:
        rule = info.data.get("rule")
        if in_a_row is not None and rule is not None and rule not in LIMITED:
            raise ValueError(f"the rule {rule!r} has no random order; remove in_a_row")
        return in_a_row

    def why_not(self, levels: int) -> str:
        """Return why so many levels cannot be ordered so; nothing where they can."""
        if self.rule != "shuffled" or self.in_a_row is None:
            return ""
        if levels == 1 and self.times > self.in_a_row:
            return (
                f"one level, {self.times} times, which cannot come at most {self.in_a_row} in a "
                "row; allow more in a row, or leave in_a_row out"
            )
        # What is left of every other level, of the last one, and how often in a row that came.
        states = comb(self.times + levels - 1, levels - 1) * (self.times + 1)
        if states * min(self.in_a_row, self.times) > MOST_COUNTED:
            return (
                f"{levels} levels, {self.times} times each, are too many to draw an order at most "
                f"{self.in_a_row} in a row from; use rule: blocked, fewer times and the block "
                "repeated, or leave in_a_row out"
            )
        return ""


RuleName = Annotated[str, Field(json_schema_extra={"enum": list(RULES)})]
"""A rule in its short form; only a schema needs it, the long form is checked."""

AS_WRITTEN = LevelOrder(rule="as_written")

CONDITION = "condition"
"""Column of the trial table: which condition within participants a block is of; also what their
order is called under ``design: order:``."""

SWITCHES = ("all", "none", "group")


def _is_a_switch(said: Any) -> Any:
    if isinstance(said, str) and said not in SWITCHES:
        what = meant(said, SWITCHES) or (
            "write all, none, group for what the participant's own group is given, or a list of "
            f"names: [{said}]"
        )
        raise ValueError(f"it is {said!r}; {what}")
    return said


Switch = Annotated[Literal["all", "none", "group"] | tuple[str, ...], BeforeValidator(_is_a_switch)]
"""Which feedback is switched on: ``all``, ``none``, what the participant's ``group`` is given, or
a list of names."""


class Design(Settings):
    """The factors that are varied, and how."""

    groups: dict[FactorName, tuple[str, ...]] = Field(default_factory=dict)
    """Between-subject groups, and the feedback of each: ``{none: [], visual:
    [sphere]}``. Participants are assigned to them in equal numbers."""

    conditions: dict[FactorName, Switch] = Field(default_factory=dict)
    """Conditions within participants, and the feedback that is on in each: ``{plain: none, tone:
    [tone]}``. Every participant has all of them. A block with ``condition: 1`` has the
    participant's first, in the order of ``order: {condition: latin_square}``."""

    order: dict[str, LevelOrder] = Field(default_factory=dict)
    """For each factor of the tasks, in which order its levels come: ``{pairs: shuffled}``, or
    ``{pairs: {rule: shuffled, times: 3, in_a_row: 2}}``. Factors that are not named come as
    written. ``condition`` is the order of the conditions."""

    tracks: dict[str, Track] = Field(default_factory=dict)
    """Levels that are chosen during the session, from the participant's results: staircases and
    QUEST+. Blocks name them as ``track``."""

    primary: tuple[str, ...] = ()
    """Primary outcomes of the study: results of its tasks or measures of a
    movement, ``[circle_to_circle, absolute_error]``. Their trends share one correction for several
    tests; where none are named, all outcomes that the report tests share it. They are named here
    and not to ``labcrane report``: one that is chosen after data collection is not primary."""

    @field_validator("conditions")
    @classmethod
    def _several(cls, conditions: dict[str, Switch]) -> dict[str, Switch]:
        if len(conditions) == 1:
            raise ValueError(
                f"{next(iter(conditions))!r} is the only condition; write two or more, or feedback "
                "at the block"
            )
        if "" in conditions:
            raise ValueError("a condition has no name; give it one")
        return conditions

    @property
    def positions(self) -> int:
        """How many conditions a participant has, one after another; 0 without any."""
        return len(self.conditions) * self.order.get(CONDITION, AS_WRITTEN).times

    @field_validator("primary")
    @classmethod
    def _once(cls, primary: tuple[str, ...]) -> tuple[str, ...]:
        for at, name in enumerate(primary):
            if name in primary[:at]:
                raise ValueError(f"{name!r} is listed twice; list it once")
        return primary

    @field_validator(
        "order", mode="before", json_schema_input_type=dict[str, RuleName | LevelOrder]
    )
    @classmethod
    def _in_the_long_form(cls, order: Any) -> Any:
        if not isinstance(order, dict):
            return order
        return {
            factor: {"rule": said} if isinstance(said, str) else said
            for factor, said in order.items()
        }


class Criterion(Settings):
    """End of practice."""

    successes: PositiveInt
    """Number of counted trials in a row that must succeed."""

    rounds: Annotated[PositiveInt, AtMost(1000)] = 1
    """Most repetitions of the block; the record states whether the criterion was met."""
