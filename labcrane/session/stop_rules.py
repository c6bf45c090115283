"""Stop rules of a session: what they come to after a questionnaire or a trial, as events."""

from collections.abc import Iterable, Iterator, Mapping

from labcrane.core.records import Value
from labcrane.protocol.evaluation import StopRule

MET, UNJUDGED = "stop_rule.met", "stop_rule.unjudged"

Said = tuple[str, dict[str, Value]]
"""Name and data of an event that follows."""


def after_questionnaire(
    rules: Iterable[StopRule], questionnaire: str, scores: Mapping[str, float]
) -> Iterator[Said]:
    """Yield the rules on a questionnaire that its scores meet."""
    for rule in rules:
        if rule.questionnaire == questionnaire and rule.met(value := scores[str(rule.score)]):
            about = {"questionnaire": questionnaire, "score": rule.score}
            yield MET, {**about, **rule.limit, "value": value}


def after_trial(rules: Iterable[StopRule], row: Mapping[str, Value]) -> Iterator[Said]:
    """Yield the rules on estimates that a trial's row meets, and those that it cannot judge."""
    for rule in rules:
        if rule.estimate is None:
            continue
        about: dict[str, Value] = {"estimate": rule.estimate, "trial": row["trial"]}
        mean = row[rule.column]
        if not isinstance(mean, float):
            yield UNJUDGED, {**about, "why": "the estimate had no value in the trial"}
        elif rule.met(mean):
            yield MET, {**about, **rule.limit, "value": mean}
