"""The report of a study: one page, one page per participant, figures and tables."""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.analysis.cohort import Cohort, Participant, Status
from labcrane.analysis.measures import DEFAULTS, MEASURES, MeasureSettings, measures_of
from labcrane.analysis.parallel import work
from labcrane.analysis.quality import exclusions, is_result, loop_quality, sync_quality
from labcrane.analysis.report import figures
from labcrane.analysis.report.html import Page
from labcrane.analysis.statistics.anova import repeated_measures
from labcrane.analysis.statistics.fitts import throughput
from labcrane.analysis.statistics.learning import learning_curves
from labcrane.analysis.statistics.trends import holm, linear_trend, mixed_model
from labcrane.errors import LabcraneError
from labcrane.recording.participant_file.writer import DAMAGED

if TYPE_CHECKING:
    import pandas as pd

PRIMARY = ("movement_time", "absolute_error")
"""What is tested; their trends share one Holm correction."""

SHOWN = ("movement_time", "absolute_error", "path_ratio", "sub_movements", "sparc", "ldlj")


def write_report(
    cohort: Cohort,
    folder: Path,
    settings: MeasureSettings = DEFAULTS,
    progress: Callable[[int, int], None] | None = None,
    leave_out: Callable[[str, str], None] | None = None,
    workers: int = 1,
    scheduler: str | None = None,
) -> Path:
    """Write the report of a cohort into ``folder``; return the page to open.

    Each worker reads one participant after the other; of each only movements and qualities are
    kept.

    Parameters
    ----------
    progress
        Told how many participants are done, of how many.
    leave_out
        Told whose data cannot be used, and why; the report is of the others, and says so.
    workers, scheduler
        Who does it; see :func:`labcrane.analysis.parallel.work`.
    """
    import pandas as pd

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "participants").mkdir(exist_ok=True)
    one = partial(_one, settings=settings, folder=folder.resolve())
    found = {}
    for name, why, *tables in work(one, cohort.included, workers, scheduler):
        if why:
            cohort = cohort.without(name, why)
            if leave_out is not None:
                leave_out(name, why)
        else:
            found[name] = tables
        if progress is not None:
            progress(len(found), len(cohort.included))
    in_order = [found[participant.name] for participant in cohort.included]
    movements, loops, syncs = zip(*in_order, strict=True)
    everything = pd.concat(movements, ignore_index=True)
    page = Page(_title(cohort.included[0]), folder / "report.html", folder)
    _stamp(page, [participant.status for participant in cohort.included])
    page.links({p.name: f"participants/{p.name}.html" for p in cohort.included})
    _who(page, cohort, everything)
    results = everything[is_result(everything)]
    if _is_aiming(results):
        _movements(page, results)
        _statistics(page, results)
    page.heading("Loop and clocks")
    page.table("loop_quality", pd.concat(loops, ignore_index=True))
    _syncs(page, pd.concat(syncs, ignore_index=True))
    page.heading("Definitions")
    page.say(f"Settings of the measures: {settings.as_dict()}")
    page.table("definitions", _definitions())
    everything.to_csv(folder / "tables" / "movements.csv", index=False)
    return page.write()


def _one(
    participant: Participant, settings: MeasureSettings, folder: Path
) -> "tuple[str, str, pd.DataFrame, pd.DataFrame, pd.DataFrame]":
    """Write one participant's page; return name, movements, and quality of loop and clocks.

    The second is why the data cannot be used, and then the tables are empty.
    """
    import pandas as pd

    try:
        own = measures_of(participant, settings)
        loop, sync = loop_quality(participant), sync_quality(participant)
        _participant_page(participant, own, loop, sync, folder)
    except (LabcraneError, *DAMAGED) as error:  # one recording never stops a cohort
        nothing = pd.DataFrame()
        return participant.name, _words(error), nothing, nothing, nothing
    return participant.name, "", own, loop, sync


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, LabcraneError) else f"cannot be measured: {error!r}"


def _title(participant: Participant) -> str:
    return str(participant.context.get("title", "labcrane"))


def _stamp(page: Page, statuses: list[Status]) -> None:
    for status in (Status.SIMULATED, Status.PILOT, Status.HALF_FINISHED):
        count = sum(one is status for one in statuses)
        if count:
            page.say(f"{count} of {len(statuses)} participants here are {status}.", stamp=True)


def _is_aiming(results: "pd.DataFrame") -> bool:
    needed = {"movement_time", "difficulty", "distance", "error_along"}
    return needed <= set(results) and len(results) > 0


def _who(page: Page, cohort: Cohort, everything: "pd.DataFrame") -> None:
    page.heading("Participants and exclusions")
    page.say(
        "Complete participants are included; simulated, pilot and half-finished ones only when "
        "asked for; erased, excluded and unreadable ones never."
    )
    page.table("participants", cohort.listing())
    out = exclusions(everything)
    page.say(f"{len(out)} of {len(everything)} movements count for no average.")
    page.table("excluded_movements", out)


def _movements(page: Page, results: "pd.DataFrame") -> None:
    import pandas as pd

    page.heading("Movement time and accuracy")
    for measure in PRIMARY:
        page.draw(figures.by_sequence(results, measure))
    page.draw(figures.by_distance(results))
    page.table("errors", _errors(results))
    page.heading("Learning curves")
    curves = pd.concat([learning_curves(results, measure) for measure in PRIMARY])
    if len(curves):
        unknown = int((curves["identified"] == "no").sum())
        page.say(f"In {unknown} of {len(curves)} fits the asymptote cannot be told from the data.")
        page.draw(figures.learning(results, curves, "movement_time"))
    page.heading("Fitts' law and throughput")
    page.draw(figures.fitts(results))
    page.draw(figures.throughputs(throughput(results)))
    page.heading("Use of the sticks")
    page.draw(figures.sticks(results))


def _errors(results: "pd.DataFrame") -> "pd.DataFrame":
    """Return constant, variable and absolute error along the axis and movement time."""
    import numpy as np

    own = results.groupby("participant")
    return own.agg(
        movements=("trial", "size"),
        movement_time_s=("movement_time", "mean"),
        constant_error_m=("constant_error", "mean"),
        variable_error_m=("constant_error", lambda values: float(np.std(values))),
        absolute_error_m=("absolute_error", "mean"),
    ).reset_index()


def _statistics(page: Page, results: "pd.DataFrame") -> None:
    page.heading("Statistics")
    anovas = anova_table(results)
    if anovas.empty:
        page.say("Tests need three or more participants with a value at every level.")
        return
    page.say(
        "Repeated-measures analysis of variance over participants' means; p_gg is corrected after "
        "Greenhouse and Geisser. It says that some positions differ, not in which direction."
    )
    page.table("anova", anovas)
    page.say("Linear trends over the sequence; p_holm is corrected for the two primary measures.")
    page.table("trends", trend_table(results))
    for measure in PRIMARY:
        model = mixed_model(results, measure)
        if model is None:
            page.say(f"No mixed model of {measure} could be fitted.")
            continue
        slopes = "with" if model.slopes else "without (the data could not carry them)"
        page.say(
            f"log {measure}, {model.n} movements of {model.participants} participants, {slopes} a "
            f"slope for each participant; standard deviation over participants "
            f"{model.participant_sd:.3g}, residual {model.residual_sd:.3g}."
        )
        page.table(f"mixed_model_{measure}", model.terms)


def anova_table(results: "pd.DataFrame") -> "pd.DataFrame":
    """Return the tests of both primary measures over sequence and distance."""
    import pandas as pd

    tests = [
        repeated_measures(results, measure, factor)
        for measure in PRIMARY
        for factor in ("sequence", "distance")
    ]
    rows = [asdict(test) | {"left_out": " ".join(test.left_out)} for test in tests if test]
    return pd.DataFrame(rows)


def trend_table(results: "pd.DataFrame") -> "pd.DataFrame":
    """Return the trends of both primary measures, corrected together."""
    import pandas as pd

    found = [trend for m in PRIMARY if (trend := linear_trend(results, m)) is not None]
    corrected = holm([trend.p for trend in found])
    return pd.DataFrame(
        [
            {**asdict(trend), "slope_low": trend.slope_ci[0], "slope_high": trend.slope_ci[1]}
            | {"p_holm": p}
            for trend, p in zip(found, corrected, strict=True)
        ]
    ).drop(columns="slope_ci", errors="ignore")


def _syncs(page: Page, syncs: "pd.DataFrame") -> None:
    if syncs.empty:
        page.say("No streams of others were recorded: there is one clock.")
    else:
        page.table("sync_quality", syncs)


def _definitions() -> "pd.DataFrame":
    import pandas as pd

    rows = [(name, unit, meaning) for name, (unit, meaning) in MEASURES.items()]
    return pd.DataFrame(rows, columns=["measure", "unit", "meaning"])


def _participant_page(
    participant: Participant,
    own: "pd.DataFrame",
    loop: "pd.DataFrame",
    sync: "pd.DataFrame",
    folder: Path,
) -> None:
    path = folder / "participants" / f"{participant.name}.html"
    page = Page(participant.name, path, folder, prefix=f"{participant.name}_")
    page.links({"study": "../report.html"})
    _stamp(page, [participant.status])
    page.say(participant.why)
    results = own[is_result(own)]
    if _is_aiming(results):
        curves = learning_curves(results, "movement_time")
        if len(curves):
            page.draw(figures.learning(results, curves, "movement_time"))
        page.draw(figures.by_distance(results))
        page.draw(figures.fitts(results))
        page.draw(figures.sticks(results))
        page.table("movements", results[["trial", "sequence", "distance", *SHOWN]])
    page.heading("Exclusions")
    page.table("excluded_movements", exclusions(own))
    page.heading("Loop and clocks")
    page.table("loop_quality", loop)
    _syncs(page, sync)
    page.write()
