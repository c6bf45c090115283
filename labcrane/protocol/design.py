"""Design section of a protocol."""

from typing import Annotated, Any

from pydantic import Field, PositiveInt, field_validator

from labcrane.core.settings import Settings
from labcrane.files.model import AtMost

RULES = ("as_written", "blocked", "latin_square", "shuffled", "williams")
"""What a protocol may say under ``design: order:``; :mod:`labcrane.design.order` follows it."""

LIMITED = frozenset({"shuffled", "blocked"})
"""Rules that can be told how often a level may come in a row."""


class Order(Settings):
    """In which order the levels of a factor come."""

    rule: str
    """``as_written``; ``shuffled``: all repetitions together; ``blocked``: each repetition by
    itself; ``latin_square`` or ``williams``: each participant has a row of the square."""

    times: Annotated[PositiveInt, AtMost(1000)] = 1
    """How often each level comes in a block."""

    in_a_row: PositiveInt | None = None
    """How often a level may come in a row, where the order is random."""


RuleName = Annotated[str, Field(json_schema_extra={"enum": list(RULES)})]
"""A rule in its short form; only a schema needs it, the long form is checked."""

AS_WRITTEN = Order(rule="as_written")


class Design(Settings):
    """What is varied, and how."""

    groups: dict[str, tuple[str, ...]] = Field(default_factory=dict)
    """Between-subject groups, and the feedback that each is given: ``{none: [], visual:
    [sphere]}``. Participants are spread over them equally."""

    order: dict[str, Order] = Field(default_factory=dict)
    """For each factor of the tasks, in which order its levels come: ``{pairs: shuffled}``, or
    ``{pairs: {rule: shuffled, times: 3, in_a_row: 2}}``. Factors that are not named come as
    written."""

    @field_validator("order", mode="before", json_schema_input_type=dict[str, RuleName | Order])
    @classmethod
    def _rules_exist(cls, order: Any) -> Any:
        if not isinstance(order, dict):
            return order
        long = {
            factor: {"rule": said} if isinstance(said, str) else said
            for factor, said in order.items()
        }
        for factor, said in long.items():
            rule = said.get("rule") if isinstance(said, dict) else None
            if isinstance(rule, str) and rule not in RULES:
                raise ValueError(f"{factor} is {rule!r}; it can be {', '.join(RULES)}")
            if isinstance(rule, str) and said.get("in_a_row") and rule not in LIMITED:
                raise ValueError(f"{factor} is {rule!r}, where nothing is random; drop in_a_row")
        return long


class Criterion(Settings):
    """When practice is enough."""

    successes: PositiveInt
    """How many counted trials in a row must succeed."""

    rounds: Annotated[PositiveInt, AtMost(1000)] = 1
    """How many times the block is run at most; whether it was enough is recorded."""
