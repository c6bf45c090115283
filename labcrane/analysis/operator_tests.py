"""The tests of operators, collected from participant files.

A test is a counted trial that is neither practice nor reference; the columns that make it one are
in docs/indicator.md.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Cohort
from labcrane.analysis.indicator import Indicator, Performance, indicate
from labcrane.analysis.indicator_settings import IndicatorSettings
from labcrane.errors import RecordingError
from labcrane.recording.participant_file.reader import Recording, SessionRecord

if TYPE_CHECKING:
    import pandas as pd

COUNTS = {
    "object": "n_object",
    "body": "n_body",
    "overload_max": "n_overload_max",
    "overload_min": "n_overload_min",
}
TIME = "time"
RATINGS = {"accuracy": "subjective_accuracy", "awareness": "situational_awareness"}
OVERRIDE = "order.override"


@dataclass(frozen=True, slots=True)
class OperatorTest:
    """One test of one operator, with what came of it.

    Attributes
    ----------
    scenario
        The trial's condition ``scenario``; the block's name where it has none.
    reference_s
        The operator's reference time, in seconds.
    why
        Where the completion factor comes from.
    """

    operator: str
    session: int
    trial: int
    scenario: str
    performance: Performance
    reference_s: float
    why: str
    indicator: Indicator
    settings: IndicatorSettings


def operator_tests(cohort: Cohort, settings: IndicatorSettings | None = None) -> list[OperatorTest]:
    """Return all tests of who is included, by operator, session and time.

    ``settings`` takes the place of what each session was recorded with.

    Raises
    ------
    RecordingError
        There is no test, or an operator has no reference stage.
    """
    people = cohort.included
    tests = [test for person in people for test in _tests(person.recording, settings)]
    if not tests:
        raise RecordingError(
            f"no test in {cohort.folder}: {len(people)} participant files, and no trial with the "
            f"columns {', '.join((TIME, *COUNTS.values()))}; a scenario task records them"
        )
    return tests


def _tests(recording: Recording, settings: IndicatorSettings | None) -> Iterator[OperatorTest]:
    reference: list[float] = []
    for number, session in zip(recording.sessions, recording, strict=True):
        trials = session.trials
        if not {TIME, *COUNTS.values()} <= set(trials.columns):
            continue
        rows = trials.to_dict("records")
        here = [float(row[TIME]) for row in rows if _is_reference(row)]
        reference = here or reference  # the latest stage that there is
        for row in rows:
            if row["practice"] != 1 and row.get("reference") != 1 and row["outcome"] != "repeated":
                mean = _mean(reference, recording, number)
                used = settings or _settings(session)
                yield _test(recording.participant, number, session, row, mean, used)


def _is_reference(row: Mapping[Any, Any]) -> bool:
    return row.get("reference") == 1 and row["outcome"] == "success"


def _mean(reference: Sequence[float], recording: Recording, session: int) -> float:
    if not reference:
        raise RecordingError(
            f"{recording.participant} has no reference stage that was completed in or before "
            f"session {session} ({recording.path}); the indicator needs the operator's own "
            "reference time: run a step 'reference: {task: ...}' first"
        )
    return sum(reference) / len(reference)


def _settings(session: SessionRecord) -> IndicatorSettings:
    return IndicatorSettings.model_validate(session.context.get("indicator", {}))


def _test(
    operator: str,
    number: int,
    session: SessionRecord,
    row: Mapping[Any, Any],
    reference_s: float,
    settings: IndicatorSettings,
) -> OperatorTest:
    counts = {name: int(row[column]) for name, column in COUNTS.items()}
    overruled = _overruled(session, row)
    completed, why = completion(row, max(counts.values()), settings, overruled=overruled)
    answers = session.questionnaires
    performance = Performance(
        float(row[TIME]),
        **counts,
        accuracy=_rating(answers, RATINGS["accuracy"], row),
        awareness=_rating(answers, RATINGS["awareness"], row),
        completed=completed,
    )
    scenario = str(row.get("scenario") or row["block_name"])
    indicator = indicate(performance, reference_s, settings)
    return OperatorTest(
        operator,
        number,
        int(row["trial"]),
        scenario,
        performance,
        reference_s,
        why,
        indicator,
        settings,
    )


def completion(
    row: Mapping[Any, Any], worst: int, settings: IndicatorSettings, *, overruled: bool
) -> tuple[bool, str]:
    """Return the completion factor of a trial, and who or what set it."""
    flag = row.get("completion", math.nan)
    if flag in {0, 1}:
        return flag == 1, "set by the supervisor"
    if worst > settings.mistakes and not overruled:
        return False, f"more than {settings.mistakes} mistakes of one kind"
    if row["outcome"] == "success":
        return True, "overridden by the supervisor" if overruled else "the task was done"
    return False, f"the trial ended with {row['outcome']}"


def _overruled(session: SessionRecord, row: Mapping[Any, Any]) -> bool:
    events = session.events
    of_trial = events[(events["name"] == OVERRIDE) & (events["trial"] == row["trial"])]
    return any(data.get("refused") is None for data in of_trial["data"])


def _rating(answers: "pd.DataFrame", asked: str, row: Mapping[Any, Any]) -> float:
    """Return the share of the rating of this trial, else of the next one given after it."""
    if answers.empty:
        return math.nan
    scores = answers[(answers["questionnaire"] == asked) & (answers["kind"] == "score")]
    own = scores[scores["trial"] == row["trial"]]
    later = scores[scores["trial"].isna() & (scores["time"] >= row["ended"])]
    for found in (own.tail(1), later.sort_values("time").head(1)):
        if len(found):
            return float(found["value"].iloc[0])
    return math.nan
