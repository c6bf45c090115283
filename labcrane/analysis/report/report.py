"""The report of a study: one page, one page per participant, figures and tables."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.analysis.codebook import trial_codebook
from labcrane.analysis.cohort import INCLUDABLE, Cohort, Participant, kinds_of
from labcrane.analysis.gaze import fixations_of, with_unseen_areas
from labcrane.analysis.gaze_streams import unmeasured_of
from labcrane.analysis.measures import DEFAULTS, measures_of
from labcrane.analysis.parallel import work
from labcrane.analysis.quality import (
    estimates_quality,
    exclusions,
    is_result,
    loop_backs,
    loop_quality,
    sync_quality,
    without_onset,
)
from labcrane.analysis.questionnaires import answers_of, scores_of
from labcrane.analysis.report import figures, outcomes
from labcrane.analysis.report.answer import answer, listed
from labcrane.analysis.report.factors import (
    CONDITION,
    GROUP,
    PLACE,
    factors_of,
    running,
    with_factors,
)
from labcrane.analysis.report.findings import Results, findings_of
from labcrane.analysis.report.html import Page
from labcrane.analysis.report.protocols import in_words as protocols_in_words
from labcrane.analysis.report.protocols import unlike_protocols
from labcrane.analysis.report.sample import in_words, sample
from labcrane.analysis.report.thresholds import Judge, add_thresholds, thresholds_of
from labcrane.analysis.report.words import STYLES, paragraphs
from labcrane.analysis.statistics.errors import errors
from labcrane.analysis.statistics.fitts import throughput
from labcrane.analysis.statistics.learning import learning_curves
from labcrane.analysis.statistics.mixed import TIMES, MixedModel, NoModelError, mixed_model
from labcrane.analysis.statistics.time_outs import time_outs
from labcrane.analysis.statistics.time_scales import QUANTITIES, TAKEN
from labcrane.analysis.tables.annotations import annotations_of
from labcrane.analysis.tables.load import correlations, load_table
from labcrane.analysis.unusable import Unusable
from labcrane.files.yaml import parse_yaml
from labcrane.recording.participant_file.writer import kept_open

if TYPE_CHECKING:
    import pandas as pd

SHOWN = ("movement_time", "absolute_error", "path_ratio", "sub_movements", "sparc", "ldlj")


FAULTS = "faults.txt"
"""Tracebacks of faults of labcrane, for a bug report."""


def write_report(
    cohort: Cohort,
    folder: Path,
    progress: Callable[[int, int], None] | None = None,
    leave_out: Callable[[str, Unusable], None] | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    unprobed: Sequence[str] = (),
    judge: Judge | None = None,
) -> Path:
    """Write the report of a cohort into ``folder``; return the page to open.

    Each worker reads one participant after the other; only movements and qualities are kept.

    Parameters
    ----------
    progress
        Called with the number of completed participants, and of all.
    leave_out
        Called with a participant whose data cannot be used, and the reason; the report is of the
        others, and states so.
    workers, scheduler
        The workers; see :func:`labcrane.analysis.parallel.work`.
    unprobed
        Streams whose clock offset was never measured but which are used, in words.
    judge
        Returns how well a recorded track finds thresholds; by default it is not reported.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "participants").mkdir(exist_ok=True)
    one = partial(_one, folder=folder.resolve())
    found: dict[str, Tables] = {}
    for name, made in work(one, cohort.included, workers, scheduler):
        if not isinstance(made, Unusable):
            found[name] = made
        else:
            cohort = cohort.without(name, made.status, made.why)
            if made.trace:
                with (folder / FAULTS).open("a", encoding="utf-8") as kept:
                    kept.write(f"{name}\n{made.trace}\n")
            if leave_out is not None:
                leave_out(name, made)
        if progress is not None:
            progress(len(found), len(cohort.included))
    of_each = {person.name: found[person.name] for person in cohort.included}
    groups = {name: _group(own["movements"]) for name, own in of_each.items()}
    tables = _joined(list(of_each.values()))
    everything = with_unseen_areas(tables["movements"])
    kinds = kinds_of(cohort.included)
    page = Page(_title(cohort.included), folder / "report.html", folder, footer=kinds)
    _stamp(page, cohort.included)
    page.links({p.name: f"participants/{p.name}.html" for p in cohort.included})
    _who(page, cohort, everything)
    about = _sample(page, cohort, tables["answers"], groups)
    results, defined = None, _definitions(cohort, everything)
    if _is_aiming(everything[is_result(everything)]):
        units = dict(zip(defined["measure"], defined["unit"], strict=True))
        primary, planned = _primary(cohort), _planned_groups(cohort)
        results = _study(page, everything, tables["scores"], groups, about, primary, units, planned)
    add_thresholds(page, tables["thresholds"], judge)
    _drifts(page, tables["drifts"])
    page.rows(
        "unmeasured_gaze",
        tables["unmeasured"],
        "These streams were recorded completely, but no measure uses them:",
        "Gaze that is not measured",
    )
    page.heading("Loop and clocks")
    page.table("loop_quality", tables["loop"])
    _syncs(page, tables)
    if unprobed:
        page.say(f"Used on request, though timestamp accuracy is unknown: {'; '.join(unprobed)}.")
    page.lead(answer(cohort, everything, (tables["loop"], tables["sync"]), about, results))
    page.heading("Definitions")
    words = "; ".join(f"{name} {_setting(value)}" for name, value in asdict(DEFAULTS).items())
    page.say(f"Settings of the measures: {words}.")
    page.say(
        "A movement begins when the tip is first faster than onset_speed for onset_hold, columns "
        "of the movements, and its halts are part of it; reaction_time is that of the sticks."
    )
    page.table("definitions", defined)
    everything.to_csv(folder / "tables" / "movements.csv", index=False)
    return page.write()


TABLES: Mapping[str, Callable[[Participant], "pd.DataFrame"]] = {
    "loop": loop_quality,
    "sync": sync_quality,
    "estimates": estimates_quality,
    "loop_backs": loop_backs,
    "answers": answers_of,
    "scores": scores_of,
    "thresholds": thresholds_of,
    "drifts": fixations_of,
    "unmeasured": unmeasured_of,
}
"""What is read of each participant in addition to the movements, and joined over the cohort."""

Tables = dict[str, "pd.DataFrame"]


def _joined(of_each: Sequence[Tables]) -> Tables:
    """Return tables of participants as those of the cohort."""
    import pandas as pd

    joined = {}
    for name in of_each[0]:
        tables = [one[name] for one in of_each]
        filled = [table for table in tables if len(table)]  # others have no types to go by
        joined[name] = pd.concat(filled, ignore_index=True) if filled else tables[0]
    return joined


def _one(participant: Participant, folder: Path) -> tuple[str, Tables | Unusable]:
    """Write one participant's page; return the tables, or the reason why there are none."""
    try:
        with kept_open(participant.path):
            own = measures_of(participant)
            if GROUP not in own:  # trials say it where the study has groups
                own.insert(0, GROUP, str(participant.context.get("group", "")))
            tables = {"movements": own} | {name: of(participant) for name, of in TABLES.items()}
            _participant_page(participant, tables, folder)
    except Exception as error:  # noqa: BLE001 - one recording never stops a cohort
        return participant.name, Unusable.of(error)
    return participant.name, tables


def _group(movements: "pd.DataFrame") -> str:
    """Return the participant's group; empty if there is none, or no movement."""
    return str(movements[GROUP].iloc[0]) if len(movements) else ""


def _primary(cohort: Cohort) -> list[str]:
    """Return the primary outcomes of all recordings, in their order."""
    named = [person.context.get("primary", ()) for person in cohort.included]
    return list(dict.fromkeys(str(name) for names in named for name in names))


def _planned_groups(cohort: Cohort) -> set[str]:
    """Return the groups of the recorded protocols; the recording of a group may still lack."""
    texts = {str(person.context.get("protocol", "")) for person in cohort.included}
    written = [parse_yaml(text, "the protocol", recorded=True) for text in texts if text]
    return {str(name) for each in written for name in each.get("design", {}).get("groups", ())}


def _title(participants: Sequence[Participant]) -> str:
    """Return the study's title, after the kind of participants."""
    title = str(participants[0].context.get("title", "labcrane"))
    kinds = kinds_of(participants)
    return f"{kinds}: {title}" if kinds else title


def _stamp(page: Page, people: Sequence[Participant]) -> None:
    for status in INCLUDABLE:
        count = sum(status in one.needs for one in people)
        if count:
            page.say(f"{count} of {len(people)} participants here are {status}.", stamp=True)


def _is_aiming(results: "pd.DataFrame") -> bool:
    needed = {"movement_time", "difficulty", "distance", "error_along"}
    return needed <= set(results) and len(results) > 0


def _who(page: Page, cohort: Cohort, everything: "pd.DataFrame") -> None:
    page.heading("Participants and exclusions")
    page.say(
        "Complete participants are included; simulated, pilot and half-finished ones only when "
        "requested; erased, excluded and unreadable ones never."
    )
    page.table("participants", cohort.listing())
    out = exclusions(everything)
    page.say(f"{len(out)} of {len(everything)} movements are excluded from means.")
    page.table("excluded_movements", out)
    still = everything[without_onset(everything)]
    page.rows(
        "without_onset",
        still.reindex(columns=["participant", "session", "trial", "attempt", "outcome", "error"]),
        f"In {listed(still)} the movement has no onset: it was over before anything moved. "
        "Their errors say where the machine was; accuracy and time measures exclude them.",
    )


def _sample(page: Page, cohort: Cohort, answers: "pd.DataFrame", groups: dict[str, str]) -> str:
    """Add the participants and their protocols, and return them in words."""
    unlike = unlike_protocols(cohort)
    page.say(protocols_in_words(unlike))
    page.rows("protocols", unlike)
    people = sample(answers, groups)
    page.heading("Sample")
    page.table("sample", people)
    about = in_words(people)
    return f"{about} {protocols_in_words(unlike)}" if len(unlike) else about


def _study(
    page: Page,
    everything: "pd.DataFrame",
    scores: "pd.DataFrame",
    groups: dict[str, str],
    about: str,
    primary: Sequence[str],
    units: Mapping[str, str],
    planned_groups: Collection[str] = (),
) -> Results:
    """Add the results for the whole cohort, and return them."""
    everything = with_factors(everything)
    factors = factors_of(everything, groups, planned_groups)
    scores = outcomes.with_conditions(scores, everything)
    recorded = everything[everything["practice"].astype(float) == 0.0]
    results = everything[is_result(everything)]
    study = outcomes.StudyMovements(results, recorded, factors, primary)
    found = Results(
        about,
        time_outs(everything, [*factors.between, *factors.by_phase, "distance"]),
        factors,
        findings=findings_of(study, everything, scores),
        primary=tuple(primary),
        units=units,
    )
    page.heading("Time-outs")
    page.say(
        "Times from the trial's start. A mean of successes alone makes a hard condition look fast; "
        "in the median (Kaplan and Meier) time-outs are censored at the time limit."
    )
    page.table("time_outs", found.time_outs)
    _movements(page, results, found, study.measures)
    _statistics(page, found, study.measures)
    for measure in study.measures:
        _mixed(page, results.assign(sequence=results[PLACE]), measure)
    _gaze(page, results, found)
    _load(page, results, scores)
    if len(scores):
        page.heading("Questionnaires")
        page.table("scores", outcomes.score_table(scores, groups))
        page.rows(
            "scores_by_condition",
            outcomes.score_table(scores, groups, CONDITION),
            "By condition; columns of those tested are of participants who answered after each:",
        )
        page.table("score_tests", found.table("score_tests"))
    page.heading("What was not tested")
    if len(short := found.shortfalls()):
        page.say(
            "Planned tests that were not possible, or not with all participants and levels: a test "
            "includes participants with a value in each of its cells."
        )
        page.table("shortfalls", short)
    else:
        page.say("Every planned test was made with all participants and levels.")
    _in_words(page, found)
    return found


def _in_words(page: Page, results: Results) -> None:
    page.heading("Results in words")
    for text in paragraphs(results, STYLES["html"]):
        page.say(text)
    for name in ("md", "tex"):
        page.text(f"results.{name}", "\n\n".join(paragraphs(results, STYLES[name])) + "\n")


def _movements(
    page: Page, movements: "pd.DataFrame", found: Results, measures: Sequence[str]
) -> None:
    import pandas as pd

    results = running(movements, found.factors)
    page.heading("Movement time and accuracy")
    for measure in measures:
        tested = running(found.in_positions(movements, measure), found.factors)
        page.draw(figures.by_sequence(results, measure, tested))
    page.draw(figures.by_distance(results))
    if outcomes.rests_apart(results):
        page.say(_rests(results))
    page.say(
        "Constant, variable and absolute error (absolute_error_along_m) are along the task axis, "
        "variable error within conditions. Radial error (radial_error_m, of the measure "
        "absolute_error) is the distance from the centre in any direction."
    )
    page.table("errors", errors(results))
    page.heading("Learning curves")
    in_phase = results.assign(sequence=results[PLACE])
    curves = pd.concat([learning_curves(in_phase, measure) for measure in measures])
    if len(curves):
        unknown = int((curves["identified"] == "no").sum())
        page.say(
            f"In {unknown} of {len(curves)} fits the asymptote cannot be determined from the data."
        )
        for measure in measures:
            page.draw(figures.learning(results, curves, measure))
    page.heading("Fitts' law and throughput")
    page.draw(figures.fitts(results))
    page.draw(figures.throughputs(throughput(results)))
    if results["simultaneous"].notna().any():
        page.heading("Use of the sticks")
        page.draw(figures.sticks(results))
        if said := _coarse_sticks(results):
            page.say(said)


def _rests(results: "pd.DataFrame") -> str:
    """Return the number of movements without a time from onset to rest, and the reasons."""
    missing = results[results[outcomes.TO_REST].isna() & results["movement_time"].notna()]
    moving = int((missing["at_rest"] == 0.0).sum())
    said = (
        "The time from onset to rest ends when the final rest of the movement begins; movement "
        "time includes that rest."
    )
    if not len(missing):
        return f"{said} Every movement has it."
    return (
        f"{said} {len(missing)} of {len(results)} movements have none: in {moving} the tip still "
        f"moved when they were ended, in {len(missing) - moving} it had not rested long "
        "enough."
    )


def _statistics(page: Page, found: Results, measures: Sequence[str]) -> None:
    """Add the tests of effects, contrasts, trends, time scales and practice."""
    anovas = found.tests("anova")
    page.heading("Statistics")
    page.say("A sequence starts again with each session or block.")
    page.say(_of_primary(found.primary, measures))
    if anovas:
        page.say(
            "Analysis of variance over participants' means (type III); p_gg is corrected after "
            "Greenhouse and Geisser. It shows that some levels differ, not in which direction."
        )
        if any(test.factor.endswith(outcomes.ADJUSTED) for test in anovas):
            page.say(
                "Pairs of targets come in several orders: adjusted for pairs' means, a position "
                "is compared with its pair's average, which is estimated too and costs degrees of "
                "freedom."
            )
        if any(test.beside and test.factor == CONDITION for test in anovas):
            page.say(
                "Conditions are compared with the period taken out: what changes from block to "
                "block is estimated, the same in all participants, and in no difference of them."
            )
        page.table("anova", found.table("anova"))
    scales = (
        "Two time scales: within a session or block, and from one to the next. Where adjustment "
        f"says {TAKEN}, a slope differs slightly from that of the trends above; participants "
        "without a first or last position or a session are left out of what needs it. "
        + "; ".join(f"{name}: {words}" for name, words in QUANTITIES.items())
        + "."
    )
    for name, said in {
        "contrasts": "Pairwise differences; p_holm is corrected within a factor, at one level.",
        "trends": "Linear trends over the sequence; p_holm is corrected over those of primary "
        "outcomes.",
        "time_scales": scales,
        "time_scales_by_group": "",
        "practice": "Practice compared with counted movements.",
    }.items():
        page.rows(name, found.table(name), said)


def _of_primary(primary: Sequence[str], measures: Sequence[str]) -> str:
    """Return a sentence on the primary outcomes, and on those that were not recorded."""
    if not primary:
        return f"The protocol names no primary outcomes: {', '.join(measures)} are used as such."
    said = f"Primary outcomes, as the protocol names them: {', '.join(primary)}."
    missing = [name for name in primary if name not in measures]
    return f"{said} Without a value in any movement: {', '.join(missing)}." if missing else said


def _coarse_sticks(results: "pd.DataFrame") -> str:
    """Return what decides the measures of the sticks instead of the hands; empty for nothing."""
    if "stick_step" not in results:
        return ""
    least_change = DEFAULTS.moving_rate * DEFAULTS.rate_window_s
    used, found = results["stick_step"].notna(), []
    for count, why in (
        (
            (results["stick_step"] > least_change).sum(),
            f"a stick axis changes in steps larger than {least_change:g}, which decide duty_cycle "
            "and aggressiveness",
        ),
        (
            (results["stick_least"] > DEFAULTS.hysteresis).sum(),
            f"no deflection is smaller than {DEFAULTS.hysteresis:g}, as with a dead zone, which "
            "decides reversals and the use of the axes",
        ),
        (
            (used & results["stick_centroid"].isna()).sum(),
            f"the loop is too slow for {DEFAULTS.stick_highest_hz:g} Hz, so that stick_power and "
            "stick_centroid are missing",
        ),
    ):
        if count:
            found.append(f"In {count} of {len(results)} movements {why}.")
    return " ".join(found)


def _load(page: Page, results: "pd.DataFrame", scores: "pd.DataFrame") -> None:
    """Add what a second task, the questionnaire and the sticks show of each person's load."""
    table = load_table(results, scores)
    if not len(table):
        return
    page.heading("Load")
    page.draw(figures.load(table))
    page.rows(
        "load_correlations",
        correlations(table),
        "Correlations within persons, over conditions. They show whether measures change together, "
        "not that one of them measures load. Intervals are wide for few conditions.",
    )


def _gaze(page: Page, results: "pd.DataFrame", found: Results) -> None:
    """Add dwell times, and their tests."""
    looked = outcomes.gaze_table(results, found.factors)
    if len(looked):
        page.heading("Gaze")
        page.say(
            "Dwell times of areas, before onset and during movements, and the time from the first "
            "look to onset, in seconds. Tests are of one area each, without a correction for their "
            "number. gaze_valid is the share of the time in which the gaze position is known; "
            "the rest is counted as not looking."
        )
        if little := outcomes.little_gaze(results):
            page.say(
                f"In {little} of {len(results)} movements the gaze position is known for less than "
                "half of the time before onset, or of the movement: dwell times are too short "
                "there, or missing."
            )
        page.table("gaze", looked)
        page.rows("gaze_tests", found.table("gaze_tests"))


def _drifts(page: Page, looked: "pd.DataFrame") -> None:
    """Add the distances of gaze from the fixation points of the eye tracker's checks."""
    if not len(looked):
        return
    page.heading("Drift of gaze")
    page.say(
        "Distance of gaze from the fixation points, in each check of the eye tracker: medians of "
        "the points' offsets and of their precision, and the worst point."
    )
    by = looked.groupby(["participant", "session", "step"], as_index=False)
    page.table(
        "drifts",
        by.agg(
            points=("point", "count"),
            right_deg=("right_deg", "median"),
            down_deg=("down_deg", "median"),
            deg=("deg", "median"),
            worst_deg=("deg", "max"),
            spread_deg=("spread_deg", "median"),
            right_px=("right_px", "median"),
            down_px=("down_px", "median"),
            valid=("valid", "min"),
        ),
    )


def _mixed(page: Page, results: "pd.DataFrame", measure: str) -> None:
    try:
        model = mixed_model(results, measure)
    except NoModelError as error:
        page.say(f"No mixed model of {measure}: {error}.")
        return
    page.say(" ".join(_of_model(model)))
    page.table(f"mixed_model_{measure}", model.terms)


def _of_model(model: MixedModel) -> Iterator[str]:
    """Yield sentences on the model, and on what could not be modelled."""
    without = f" ({model.missing} more have no value)" if model.missing else ""
    spread = ", ".join(f"{name} {sd:.3g}" for name, sd in model.random.items())
    yield (
        f"Mixed model of {model.measure}: {model.formula}, sequence and difficulty centred; "
        f"{model.n} movements{without} of {model.participants} participants. Standard deviations "
        f"over participants: {spread or 'none'}; residual {model.residual_sd:.3g}. Tests do "
        "not assume that these are right: standard errors are of each participant's own part in "
        "a term (CR2), with the degrees of freedom of Bell and McCaffrey."
    )
    if model.measure in TIMES and not model.log:
        yield "It is modelled untransformed, since a value of 0 or less has no logarithm."
    if model.alone:
        yield f"Without {', '.join(model.alone)}, alone in a group or in none."
    if model.zero:
        yield f"Without random terms whose variance is estimated as zero: {', '.join(model.zero)}."
    if model.inseparable:
        yield (
            "Without random terms that coincide with others or with the residual: "
            f"{', '.join(model.inseparable)}."
        )
    if model.reference:
        yield (
            f"Terms without a group are those of the first one, {model.reference}; terms with a "
            "group are differences from it."
        )
    for name in model.terms["term"][model.terms["p"].isna()]:
        yield f"{name} is not tested: the estimate rests on one participant."
    for name in model.dropped:
        yield f"{name} is not in the model: it cannot be distinguished from the other terms."


def _syncs(page: Page, tables: Tables) -> None:
    if tables["sync"].empty:
        page.say("No external streams were recorded: there is one clock.")
    else:
        page.table("sync_quality", tables["sync"])
    page.rows(
        "estimates",
        tables["estimates"],
        "How long after the time that a value stands for the first tick used it, and the part of "
        "the ticks that used the fallback.",
        "Estimates",
    )
    page.rows(
        "loop_back",
        tables["loop_backs"],
        "What photodiodes and microphones recorded of pictures and sounds: the delay is that of "
        "screen, sensor and device together, and a stream whose delay grows by more than is stated "
        "fails.",
        "Loop-back checks",
    )


def _setting(value: object) -> str:
    """Return a setting as people read it; one that is empty is not set."""
    if isinstance(value, tuple | list):
        return " and ".join(map(str, value))
    return str(value) or "not set"


def _definitions(cohort: Cohort, everything: "pd.DataFrame") -> "pd.DataFrame":
    """Return unit and meaning of the measures, and of the recorded columns of trials."""
    book = trial_codebook(everything, [person.context for person in cohort.included])
    table = book.rename(columns={"column": "measure", "description": "meaning"})
    return table[["measure", "unit", "meaning"]]


def _participant_page(participant: Participant, tables: Tables, folder: Path) -> None:
    own = tables["movements"]
    path = folder / "participants" / f"{participant.name}.html"
    page = Page(
        participant.name,
        path,
        folder,
        prefix=f"{participant.name}_",
        footer=kinds_of([participant]),
    )
    page.links({"study": "../report.html"})
    _stamp(page, [participant])
    page.say(participant.why)
    results = own[is_result(own)]
    if _is_aiming(results):
        page.table("movements", results[["session", "trial", "sequence", "distance", *SHOWN]])
    page.heading("Exclusions")
    page.table("excluded_movements", exclusions(own))
    page.rows(
        "annotations",
        annotations_of(participant).drop(columns=["participant", "time", "until"]),
        "Annotations made in the viewer; times are from the first frame.",
        "Marks",
    )
    page.heading("Loop and clocks")
    page.table("loop_quality", tables["loop"])
    _syncs(page, tables)
    page.write()
