"""The tests of operators, collected from participant files.

A test is a counted trial that is neither practice nor reference; the columns that make it one are
in docs/indicator.md.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import filterfalse
from typing import TYPE_CHECKING, Any

from labcrane.analysis.cohort import Cohort
from labcrane.analysis.presented import not_presented, presented
from labcrane.analysis.scoring.indicator import Indicator, Performance, indicate
from labcrane.analysis.scoring.settings import COUNTS, RATINGS, TIME, IndicatorSettings
from labcrane.analysis.unusable import Unusable
from labcrane.core.records import UNDONE, Phase
from labcrane.errors import RecordingError
from labcrane.recording.participant_file.reader import Recording, SessionRecord

if TYPE_CHECKING:
    import pandas as pd

DROPS = "n_drop"
"""Drops; reported beside what the indicator counts; a test without this column has none."""

DETECTION = ("deformity", "found", "false_reports")
"""What was reported of deformities, where a test has these columns."""

OVERRIDE = "order.override"


@dataclass(frozen=True, slots=True)
class Detection:
    """What was reported of a deformity in one test.

    Attributes
    ----------
    deformity, found
        Whether there was one, and whether it was found, as 1 or 0; NaN where none was asked about.
    false_reports
        Reports of none, or from too far away; NaN where nothing is known of them.
    """

    deformity: float = math.nan
    found: float = math.nan
    false_reports: float = math.nan

    @property
    def kind(self) -> str | None:
        """Which of hit, miss, false alarm and correct rejection it is; None where none was asked.

        Where there is a deformity, finding it counts, whatever else was reported.
        """
        if math.isnan(self.deformity):
            return None
        if self.deformity:
            return "hit" if self.found else "miss"
        return "false alarm" if self.false_reports > 0.0 else "correct rejection"


@dataclass(frozen=True, slots=True)
class OperatorTest:
    """One test of one operator, with what came of it.

    Attributes
    ----------
    scenario
        The trial's condition ``scenario``; the block's name where it has none.
    reference_s
        The operator's reference time in this scenario, in seconds.
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
    detection: Detection = Detection()


LeaveOut = Callable[[str, str], None]
"""Told whose tests cannot be scored, and why."""


def operator_tests(
    cohort: Cohort,
    settings: IndicatorSettings | None = None,
    leave_out: LeaveOut = lambda name, why: None,
) -> list[OperatorTest]:
    """Return all tests of who is included, by operator, session and time.

    Left out are skipped tests, tests without a reference, tests and references of which the
    operator was shown too little, and damaged recordings; all others are scored.

    Parameters
    ----------
    settings
        Takes the place of what each session was recorded with.
    leave_out
        Told whose tests are left out, and why.

    Raises
    ------
    RecordingError
        There is no test, or none with a reference.
    """
    people = cohort.included
    missing: list[tuple[str, str]] = []

    def without(name: str, why: str) -> None:
        missing.append((name, why))
        leave_out(name, why)

    tests: list[OperatorTest] = []
    for person in people:
        try:
            tests += _tests(person.recording, settings, without)
        except Exception as error:  # noqa: BLE001 - one recording never stops a cohort
            bad = Unusable.of(error)
            without(person.name, "\n".join(filter(None, (f"{bad.status}: {bad.why}", bad.trace))))
    if not tests and missing:
        raise RecordingError("; ".join(f"{name} {why}" for name, why in missing))
    if not tests:
        raise RecordingError(
            f"no test in {cohort.folder}: {len(people)} participant files, and no trial with the "
            f"columns {', '.join((TIME, *COUNTS.values()))}; a scenario task records them"
        )
    return tests


def _tests(
    recording: Recording, settings: IndicatorSettings | None, leave_out: LeaveOut
) -> Iterator[OperatorTest]:
    reference: dict[str, list[float]] = {}
    lacking: dict[str, int] = {}
    unseen: list[str] = []
    skipped: list[str] = []
    for number, session in zip(recording.sessions, recording, strict=True):
        trials = session.trials
        if not {TIME, *COUNTS.values()} <= set(trials.columns):
            continue
        shown = presented(session)
        failed = not_presented(trials if shown is None else shown)
        unseen += _named(filter(_counts, trials[failed].to_dict("records")), number)
        rows = trials[~failed].to_dict("records")
        here: dict[str, list[float]] = {}
        for row in filter(_is_reference, rows):
            here.setdefault(_scene(row), []).append(float(row[TIME]))
        reference |= here  # the latest stage that there is, scenario by scenario
        tests = [row for row in rows if _counts(row) and row.get("reference") != 1]
        skipped += _named(filter(_is_skipped, tests), number)
        for row in filterfalse(_is_skipped, tests):
            times = reference.get(_scene(row), [])
            if not times:
                lacking[_scene(row)] = lacking.get(_scene(row), 0) + 1
                continue
            used = settings or _settings(session)
            mean = sum(times) / len(times)
            yield _test(recording.participant, number, session, row, mean, used)
    if unseen:
        leave_out(
            recording.participant,
            f"saw or heard too little in {', '.join(unseen)}, which are not scored "
            "(presented: in the protocol)",
        )
    if skipped:
        leave_out(recording.participant, f"skipped {', '.join(skipped)}: nothing there to score")
    if lacking:
        leave_out(recording.participant, _without_reference(lacking, reference, recording))


def _counts(row: Mapping[Any, Any]) -> bool:
    """Say whether a trial is a test or of the reference, and the attempt that holds."""
    return bool(row["practice"] != 1 and row["outcome"] not in UNDONE)


def _is_skipped(row: Mapping[Any, Any]) -> bool:
    return bool(row["outcome"] == Phase.SKIPPED)


def _named(rows: Iterable[Mapping[Any, Any]], session: int) -> list[str]:
    return [f"trial {row['trial']:g} of session {session}" for row in rows]


def _scene(row: Mapping[Any, Any]) -> str:
    """Return what a reference time is of: the scenario; "" where a task has none."""
    return str(row.get("scenario") or "")


def _without_reference(
    lacking: Mapping[str, int], reference: Mapping[str, object], recording: Recording
) -> str:
    named = [f"{name!r} ({count})" for name, count in lacking.items() if name]
    scenes = f" of {', '.join(named)}" if named and reference else ""
    tests = sum(lacking.values())
    return (
        f"has no reference stage{scenes} that was completed before {tests} of the tests "
        f"({recording.path}); the indicator needs the operator's own reference time: run a step "
        "'reference: {task: ...}' first"
    )


def _is_reference(row: Mapping[Any, Any]) -> bool:
    return row.get("reference") == 1 and row["outcome"] == "success"


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
    drops = 0 if math.isnan(found := float(row.get(DROPS, 0))) else int(found)
    completed, why = completion(
        row,
        max(counts.values()),
        settings,
        overruled=_overruled(session, row),
        overruled_after=_overruled(session, row, after=True),
    )
    answers = session.questionnaires
    performance = Performance(
        float(row[TIME]),
        **counts,
        accuracy=_rating(answers, RATINGS["accuracy"], row),
        awareness=_rating(answers, RATINGS["awareness"], row),
        completed=completed,
        drop=drops,
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
        Detection(*(float(row.get(name, math.nan)) for name in DETECTION)),
    )


def completion(
    row: Mapping[Any, Any],
    worst: int,
    settings: IndicatorSettings,
    *,
    overruled: bool,
    overruled_after: bool = False,
) -> tuple[bool, str]:
    """Return the completion factor of a trial, and who or what set it.

    An end that was overridden while the trial ran lets it go on to another one; one that was
    overridden afterwards, before the next test began, does not count.
    """
    flag = row.get("completion", math.nan)
    if flag in {0, 1}:
        return flag == 1, "set by the experimenter"
    if overruled_after:
        return True, "overridden by the experimenter after its end"
    if worst > settings.mistakes and not overruled:
        return False, f"more than {settings.mistakes} mistakes of one kind"
    if row["outcome"] == "success":
        return True, "overridden by the experimenter" if overruled else "the task was done"
    return False, f"the trial ended with {row['outcome']}"


def _overruled(session: SessionRecord, row: Mapping[Any, Any], *, after: bool = False) -> bool:
    """Say whether a trial's end was overridden: while it ran, or after it, before the next."""
    events = session.events
    own = events[(events["name"] == OVERRIDE) & (events["trial"] == row["trial"])]
    return any(
        data.get("refused") is None and bool(data.get("after")) is after for data in own["data"]
    )


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
