"""Stop rules: values beyond which a session pauses."""

from pydantic import model_validator

from labcrane.core.references import EstimateValue
from labcrane.core.settings import Settings, WrongKey


class StopRule(Settings):
    """A limit of a score or an estimate; beyond it the session pauses: the experimenter decides."""

    questionnaire: str | None = None
    """Which of the study's questionnaires."""

    score: str | None = None
    """Which of its scores."""

    estimate: EstimateValue | None = None
    """Or an estimate and its value: ``load.ratio``. Its mean over each counted trial is compared,
    as soon as the trial has ended. Without any value in a trial the rule is not judged, which is
    an event."""

    above: float | None = None
    """The session pauses when the score or the mean is above this."""

    below: float | None = None
    """Or when it is below this."""

    @model_validator(mode="after")
    def _whole(self) -> "StopRule":
        by_score = self.estimate is None
        if (self.questionnaire is None) is by_score or (self.score is None) is by_score:
            raise WrongKey(
                "a stop rule has a questionnaire and its score, or else an estimate", at=()
            )
        if (self.above is None) == (self.below is None):
            raise WrongKey("a stop rule has a limit: write above or below, one of them", at=())
        return self

    @property
    def column(self) -> str:
        """The column of the trial table that has the mean of the estimate."""
        return (self.estimate or "").replace(".", "_")

    @property
    def limit(self) -> dict[str, float]:
        """The limit, by its key."""
        written = {"above": self.above, "below": self.below}
        return {key: value for key, value in written.items() if value is not None}

    def met(self, value: float) -> bool:
        """Whether a value is beyond the limit; one that is not a number never is."""
        return any(
            value > limit if key == "above" else value < limit for key, limit in self.limit.items()
        )
