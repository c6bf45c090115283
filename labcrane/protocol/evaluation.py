"""What a protocol says of how a session is judged: the indicator's weights, and stop rules."""

from typing import Literal

from pydantic import NonNegativeFloat, PositiveInt, model_validator

from labcrane.files.model import StrictModel

Reading = Literal["separate_overloads", "shared_overloads"]


class Judging(StrictModel):
    """A part of a protocol that judges: unknown keys are errors, values never change."""


class Weights(Judging):
    """Most points of each component of the performance indicator."""

    duration: NonNegativeFloat = 20.0
    """Time taken, against the operator's own reference time."""

    object: NonNegativeFloat = 20.0
    """Collisions with objects above the largest force."""

    body: NonNegativeFloat = 20.0
    """Collisions with a body above the largest force."""

    overload_max: NonNegativeFloat = 20.0
    """Overloads in the max direction; of both directions where they share one component."""

    overload_min: NonNegativeFloat = 20.0
    """Overloads in the min direction; not used where both directions share one component."""

    accuracy: NonNegativeFloat = 10.0
    """Subjective accuracy."""

    awareness: NonNegativeFloat = 10.0
    """Subjective situational awareness."""

    @model_validator(mode="after")
    def _something_counts(self) -> "Weights":
        if not any(self.model_dump().values()):
            raise ValueError("all weights are 0; at least one must be above 0")
        return self


class IndicatorSettings(Judging):
    """How the performance indicator is worked out (Typiak 2024, as reconstructed)."""

    weights: Weights = Weights()
    """Most points of each component."""

    reading: Reading = "separate_overloads"
    """``separate_overloads``: both directions of overload have a component each, 120 points by
    default; ``shared_overloads``: they are counted together in one, 100 points by default."""

    mistakes: PositiveInt = 4
    """Mistakes of one kind at which its component is 0; one more ends the test."""

    capped: bool = True
    """Whether being faster than the reference time earns no more than all points."""


class StopRule(Judging):
    """A score above which the session pauses and the examiner decides."""

    questionnaire: str
    """Which of the study's questionnaires."""

    score: str
    """Which of its scores."""

    above: float
    """The session pauses when the score is above this."""
