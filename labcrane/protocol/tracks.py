"""Tracks of a design: levels of a factor that are chosen by what the participant has done."""

import math
from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import (
    Field,
    FiniteFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    ValidationInfo,
    field_validator,
    model_validator,
)

from labcrane.core.records import Phase, Value
from labcrane.core.settings import Settings, WrongKey
from labcrane.files.model import AtMost, was_run

ROUNDING = 1e-9
"""By how much a standard deviation may be off by rounding."""

THRESHOLDS = 61
"""That QUEST+ takes for possible, evenly from the easiest to the hardest level."""

JUDGED = (Phase.SUCCESS, Phase.FAILURE, Phase.TIMEOUT)
"""How trials end that say something of the participant."""


class UpDown(Settings):
    """A staircase: harder after some successes in a row, easier after some failures (Levitt 1971).

    It converges to 71 % of successes with 2 and 1, and to 79 % with 3 and 1.
    """

    harder_after: PositiveInt = 2
    """Successes in a row after which the level gets harder."""

    easier_after: PositiveInt = 1
    """Failures in a row after which it gets easier."""

    steps: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (1,)
    """Step sizes in levels; each change of direction moves to the next one, and the last one stays:
    ``[4, 2, 1]``."""

    reversals: Annotated[int, Field(ge=2), AtMost(1000)] = 8
    """Changes of direction after which a block ends."""

    leave_out: NonNegativeInt = 2
    """Number of first reversals left out of the estimate, the mean of the levels at the rest."""

    @field_validator("leave_out")
    @classmethod
    def _some_are_left(cls, leave_out: int, info: ValidationInfo) -> int:
        reversals = info.data.get("reversals")
        if reversals is not None and leave_out > reversals - 2 and not was_run(info):
            raise ValueError(
                f"of {reversals} reversals {leave_out} are left out, and an estimate needs two; "
                f"write {reversals - 2} or less"
            )
        return leave_out


class QuestPlus(Settings):
    """Always the level whose answer is expected to be most informative (QUEST+, Watson 2017).

    Success is less likely the harder a level is: ``guess + (1 - guess - lapse) * Phi((threshold -
    level) / spread)``, Phi being the normal distribution's. Any threshold from the easiest to the
    hardest level is as likely beforehand as any other.
    """

    spreads: Annotated[tuple[PositiveFloat, ...], Field(min_length=1, max_length=20)]
    """Possible spreads, in the levels' unit, all equally likely; ``[0.5, 1, 2]``."""

    guess: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Probability of a success by chance."""

    lapse: float = Field(default=0.02, ge=0.0, lt=1.0)
    """Probability of a failure however easy the level is."""

    until_sd: PositiveFloat | None = None
    """A block ends when the standard deviation of the threshold is this or less, in the levels'
    unit; otherwise when all rounds are done."""

    @field_validator("lapse")
    @classmethod
    def _ability_matters(cls, lapse: float, info: ValidationInfo) -> float:
        guess = info.data.get("guess", 0.0)
        if guess + lapse >= 1.0:
            raise ValueError(
                f"guess {guess:g} and lapse {lapse:g} leave nothing to be measured; together they "
                "must be below 1"
            )
        return lapse


class Track(Settings):
    """Levels of a factor that are chosen round by round, from the participant's results.

    A round consists of the trials that the task makes of one level: in ``aiming``, a pair of
    circles with its approach.
    """

    factor: str
    """The factor of the task: ``pairs``."""

    levels: Annotated[dict[str, FiniteFloat], Field(min_length=2, max_length=200)]
    """Difficulty of each of its levels, a larger number being harder: ``{2m_far_left: 2,
    4m_far_left: 4}``. Other levels are not used."""

    up_down: UpDown | None = None
    """A staircase chooses; either this or ``quest_plus``."""

    quest_plus: QuestPlus | None = None
    """QUEST+ chooses."""

    start: str = ""
    """The first level; otherwise the easiest of a staircase, and the most informative of
    QUEST+."""

    rounds: Annotated[PositiveInt, AtMost(1000)] = 40
    """Maximum number of rounds of a block."""

    measure: str = ""
    """A result of the task by which successful trials are judged, within ``at_least`` and
    ``at_most``: ``movement_time``. Without it, every trial that succeeds counts as a success."""

    at_least: FiniteFloat | None = None
    """The smallest value of the measure that is a success, in its unit."""

    at_most: FiniteFloat | None = None
    """The largest value of the measure that is a success, in its unit."""

    carry: bool = True
    """Whether a session continues from the participant's results in earlier sessions."""

    @field_validator("levels")
    @classmethod
    def _differ(cls, levels: dict[str, float], info: ValidationInfo) -> dict[str, float]:
        numbers = list(levels.values())
        same = [name for name, number in levels.items() if numbers.count(number) > 1]
        if same and not was_run(info):
            raise ValueError(
                f"levels {' and '.join(map(repr, same))} are equally hard; remove all but one, "
                "or give each a different number"
            )
        return levels

    @field_validator("quest_plus")
    @classmethod
    def _something_is_to_be_learnt(
        cls, law: QuestPlus | None, info: ValidationInfo
    ) -> QuestPlus | None:
        levels = info.data.get("levels")
        if law is None or law.until_sd is None or levels is None or was_run(info):
            return law
        # Of n numbers that are evenly spaced by w: w sqrt((n^2 - 1) / 12).
        spacing = (max(levels.values()) - min(levels.values())) / (THRESHOLDS - 1)
        beforehand = spacing * math.sqrt((THRESHOLDS**2 - 1) / 12)
        if law.until_sd >= beforehand * (1.0 - ROUNDING):
            raise WrongKey(
                f"{law.until_sd:g} is reached before the first answer, when the standard "
                f"deviation of the threshold is {beforehand:.3g}; write a smaller value",
                at=("until_sd",),
            )
        return law

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if (self.up_down is None) == (self.quest_plus is None):
            there, at = (
                ("both are there", ("quest_plus",)) if self.up_down else ("neither is there", ())
            )
            told = f"{there}; one of up_down and quest_plus chooses the levels"
            raise WrongKey(told, at=at)
        if self.start and self.start not in self.levels:
            raise WrongKey(
                f"start is {self.start!r}, which is not a level; there is {', '.join(self.levels)}",
                at=("start",),
            )
        if bool(self.measure) != (self.at_least is not None or self.at_most is not None):
            limits = [key for key in ("at_least", "at_most") if getattr(self, key) is not None]
            raise WrongKey(
                "a measure has at_least, at_most or both, and they have a measure; write the "
                f"{'measure' if limits else 'limit'} as well",
                at=(limits[0] if limits else "measure",),
            )
        return self

    @model_validator(mode="after")
    def _can_be_met(self, info: ValidationInfo) -> Self:
        if was_run(info):
            return self
        least, most = self.at_least, self.at_most
        if least is not None and most is not None and least > most:
            raise WrongKey(
                f"at_least is {least:g} and at_most {most:g}: no trial is a success; write an "
                "at_most that is larger",
                at=("at_most",),
            )
        if self.up_down is not None:
            for key in ("harder_after", "easier_after", "reversals"):
                if (count := getattr(self.up_down, key)) > self.rounds:
                    written = key in self.up_down.model_fields_set
                    raise WrongKey(
                        f"up_down.{key} is {count}, and there are {self.rounds} rounds; write "
                        f"{self.rounds} or less, or more rounds",
                        at=("up_down", key) if written else ("rounds",),
                    )
        return self

    @property
    def by(self) -> str:
        """Name of the procedure that chooses the levels."""
        if self.up_down is not None:
            up_down = self.up_down
            return (
                f"a staircase, harder after {up_down.harder_after} and easier after "
                f"{up_down.easier_after}"
            )
        return "QUEST+"

    def judge(self, outcome: Phase, results: Mapping[str, Value]) -> bool | None:
        """Return whether a trial is a success; None where it does not reflect the participant."""
        if outcome not in JUDGED:
            return None
        if outcome is not Phase.SUCCESS or not self.measure:
            return outcome is Phase.SUCCESS
        value = results.get(self.measure)
        if not isinstance(value, int | float) or math.isnan(value):
            return None
        lowest = -math.inf if self.at_least is None else self.at_least
        highest = math.inf if self.at_most is None else self.at_most
        return lowest <= value <= highest
