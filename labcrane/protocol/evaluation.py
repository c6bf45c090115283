"""Stop rules: scores above which a session pauses."""

from labcrane.files.model import StrictModel


class StopRule(StrictModel):
    """A score above which the session pauses and the experimenter decides."""

    questionnaire: str
    """Which of the study's questionnaires."""

    score: str
    """Which of its scores."""

    above: float
    """The session pauses when the score is above this."""
