"""Outcomes of a study in its design: tests, contrasts, time scales, questionnaires."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from labcrane.analysis.report.factors import GROUP, PHASE, PLACE, Factors
from labcrane.analysis.statistics.anova import Anova, Contrast, analyse, compare
from labcrane.analysis.statistics.anova import word as word  # noqa: PLC0414 - of levels, here too
from labcrane.analysis.statistics.time_scales import quantities, summary, taken_away
from labcrane.analysis.statistics.trends import holm, linear_trend

if TYPE_CHECKING:
    import pandas as pd

USUAL = ("movement_time", "absolute_error", "circle_to_circle")
"""What is tested of every study that recorded it, beside the protocol's primary outcomes."""

ADJUSTED = " with pairs' means taken away"
"""Behind the name of an effect of positions, where pairs come in another order for everybody."""

SEQUENCE, DISTANCE, SIDE = "sequence", "distance", "far_side"


def measures_in(results: "pd.DataFrame", primary: Sequence[str] = ()) -> list[str]:
    """Return the outcomes that there are, the primary ones first."""
    names = dict.fromkeys([*primary, *USUAL])
    return [name for name in names if name in results and results[name].notna().any()]


def anova_table(
    results: "pd.DataFrame", factors: Factors, primary: Sequence[str] = ()
) -> "pd.DataFrame":
    """Return every test of every outcome over positions, distances, sides, phases and groups."""
    found: list[Anova] = []
    for measure in measures_in(results, primary):
        own: dict[str, Anova] = {}
        for test in tests(results, measure, factors):
            name = named(test, factors)
            own.setdefault(name, replace(test, factor=name))  # groups come with every design
        found += own.values()
    return _frame(found)


def named(test: Anova, factors: Factors) -> str:
    """Return an effect's name as the tables have it."""
    return named_factor(test.factor, factors)


def named_factor(name: str, factors: Factors) -> str:
    """Return the name of a factor, or of several with colons, as the tables have it."""
    words = {PHASE: factors.kind, PLACE: SEQUENCE}
    effect, separator, rest = name.partition(" ")
    return ":".join(words.get(part, part) for part in effect.split(":")) + separator + rest


def tests(results: "pd.DataFrame", measure: str, factors: Factors) -> Iterator[Anova]:
    """Yield the tests; what stands behind an effect's name says where and of what it is."""
    between, phases = factors.between, factors.over_phases
    # First, because most participants are whole there.
    yield from analyse(results, measure, phases, between)
    if factors.alike:
        yield from _of_places(analyse(results, measure, [*phases, PLACE], between), "")
        adjusted = results.assign(**{measure: taken_away(results, measure)})
        yield from _of_places(analyse(adjusted, measure, [*phases, PLACE], between), ADJUSTED)
    else:  # positions of phases of unequal length have nothing to do with each other
        adjusted = results.assign(**{measure: taken_away(results, measure)})
        for phase in factors.phases:
            here = results[PHASE] == phase
            where = f" in {phase}"
            tests = analyse(results[here], measure, [PLACE], between)
            yield from _of_places(tests, where)
            tests = analyse(adjusted[here], measure, [PLACE], between)
            yield from _of_places(tests, where + ADJUSTED)
    for name in (DISTANCE, SIDE):
        if name in results:
            yield from analyse(results, measure, [*phases, name], between)


def _of_places(tests: Sequence[Anova], suffix: str) -> Iterator[Anova]:
    for test in tests:
        if PLACE in test.factor.split(":"):
            yield replace(test, factor=test.factor + suffix)


def practice_table(
    everything: "pd.DataFrame", factors: Factors, primary: Sequence[str] = ()
) -> "pd.DataFrame":
    """Return the tests of practice against what counts; empty where there was none."""
    import pandas as pd

    if not factors.practice:
        return pd.DataFrame()
    done = everything[everything["outcome"] == "success"].copy()
    done["practice"] = done["practice"].astype(float).map({0.0: "counted", 1.0: "practice"})
    tests = [
        test
        for measure in measures_in(done, primary)
        for test in analyse(done, measure, ["practice"], factors.between)
    ]
    return _frame(tests)


def contrast_table(
    results: "pd.DataFrame", factors: Factors, primary: Sequence[str] = ()
) -> "pd.DataFrame":
    """Return differences of groups, of phases, and of groups in each phase, after Holm."""
    import pandas as pd

    between, phases = factors.between, factors.over_phases
    found: list[Contrast] = []
    for measure in measures_in(results, primary):
        found += compare(results, measure, GROUP, phases, between)
        found += compare(results, measure, PHASE, phases, between)
        if phases:
            found += compare(results, measure, GROUP, phases, between, at=PHASE)
        found += compare(results, measure, DISTANCE, [*phases, DISTANCE], between)
    rows = [asdict(one) | {"factor": named_factor(one.factor, factors)} for one in found]
    return pd.DataFrame(rows)


def trend_table(
    results: "pd.DataFrame", factors: Factors, primary: Sequence[str] = ()
) -> "pd.DataFrame":
    """Return the linear trends over positions in each phase; of primary outcomes, all share Holm.

    Where none is said to be primary, every outcome is one.
    """
    import pandas as pd

    measures = measures_in(results, primary)
    found = []
    for measure in measures:
        for phase in factors.phases:
            own = results[results[PHASE] == phase].assign(sequence=lambda t: t[PLACE])
            trend = linear_trend(own, measure)
            if trend is not None:
                found.append((phase, trend))
    corrected = set(primary or measures)
    p_holm = iter(holm([trend.p for _, trend in found if trend.measure in corrected]))
    rows = [
        {
            **asdict(trend),
            factors.kind: phase,
            "slope_low": trend.slope_ci[0],
            "slope_high": trend.slope_ci[1],
            "p_holm": next(p_holm) if trend.measure in corrected else float("nan"),
        }
        for phase, trend in found
    ]
    return pd.DataFrame(rows).drop(columns="slope_ci", errors="ignore")


def time_scale_tables(
    results: "pd.DataFrame", factors: Factors, primary: Sequence[str] = ()
) -> "tuple[pd.DataFrame, pd.DataFrame]":
    """Return the summary of learning within and from phase to phase, and tests between groups."""
    import pandas as pd

    tables, tests = [], []
    for measure in measures_in(results, primary):
        found = quantities(results, measure)
        tables.append(summary(found, measure))
        if not factors.between:
            continue
        for (phase, quantity), own in found.groupby(["phase", "quantity"], sort=False):
            about = {"phase": phase, "quantity": quantity}
            named = own.rename(columns={"value": measure})
            tests += [asdict(test) | about for test in analyse(named, measure, (), [GROUP])]
    return pd.concat(tables, ignore_index=True), pd.DataFrame(tests)


def score_table(scores: "pd.DataFrame", groups: dict[str, str]) -> "pd.DataFrame":
    """Return means and spreads of every score, by group and occasion."""
    import pandas as pd

    own = _occasions(scores, groups).dropna(subset=["value"])
    if own.empty:
        return pd.DataFrame()
    each = own.groupby(["outcome", GROUP, "occasion", "participant"])["value"].mean()
    table = each.groupby(level=["outcome", GROUP, "occasion"]).agg(["count", "mean", "std"])
    return table.reset_index().rename(columns={"count": "n", "std": "sd"})


def score_tests(scores: "pd.DataFrame", groups: dict[str, str]) -> "pd.DataFrame":
    """Return the tests of every score over occasions and groups."""
    own = _occasions(scores, groups)
    between = [GROUP] if len({name for name in groups.values() if name}) > 1 else []
    tests = [
        test
        for outcome, part in own.groupby("outcome")
        for test in analyse(
            part.rename(columns={"value": str(outcome)}), str(outcome), ["occasion"], between
        )
    ]
    return _frame(tests)


def _occasions(scores: "pd.DataFrame", groups: dict[str, str]) -> "pd.DataFrame":
    own = scores.copy()
    own[GROUP] = own["participant"].map(groups).fillna("")
    own["outcome"] = own["questionnaire"] + " " + own["score"]
    own["occasion"] = [
        f"session {session:g}, step {step:g}"
        for session, step in zip(own["session"], own["step"], strict=True)
    ]
    return own


def gaze_table(results: "pd.DataFrame", factors: Factors) -> "pd.DataFrame":
    """Return means of how long each area was looked at, over participants' means."""
    import pandas as pd

    columns = _of_gaze(results)
    if not columns:
        return pd.DataFrame()
    by = [*factors.between, *factors.over_phases, DISTANCE]
    each = results.groupby([*by, "participant"])[columns].mean()
    return each.groupby(level=by).mean().reset_index()


def gaze_tests(results: "pd.DataFrame", factors: Factors) -> "pd.DataFrame":
    """Return the tests of how long each area was looked at, over groups, phases and distances."""
    within = [*factors.over_phases, DISTANCE]
    tests = [
        replace(test, factor=named(test, factors))
        for name in _of_gaze(results)
        for test in analyse(results, name, within, factors.between)
    ]
    return _frame(tests)


def _of_gaze(results: "pd.DataFrame") -> list[str]:
    """Return the columns of gaze of which there is something to say."""
    names = [str(name) for name in results if str(name).startswith(("dwell_", "look_lead_"))]
    return [name for name in names if results[name].notna().any()]


def _frame(tests: Sequence[Anova]) -> "pd.DataFrame":
    import pandas as pd

    rows: list[dict[str, Any]] = [
        asdict(test) | {"left_out": " ".join(test.left_out)} for test in tests
    ]
    return pd.DataFrame(rows)
