"""Settings of the performance indicator: its weights, and how it is read."""

from typing import Literal

from pydantic import NonNegativeFloat, PositiveInt, model_validator

from labcrane.files.model import StrictModel

COUNTS = {
    "object": "n_object",
    "body": "n_body",
    "overload_max": "n_overload_max",
    "overload_min": "n_overload_min",
}
"""The columns of a trial's row that hold its mistakes, by their component of the indicator."""

RATINGS = {"accuracy": "subjective_accuracy", "awareness": "situational_awareness"}
"""The questionnaires that hold its ratings, by their component of the indicator."""

TIME = "time"
"""The column that holds how long a trial took."""

Reading = Literal["separate_overloads", "shared_overloads"]


class Weights(StrictModel):
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


class IndicatorSettings(StrictModel):
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
