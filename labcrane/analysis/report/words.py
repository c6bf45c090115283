"""Results in APA style, in HTML, Markdown and LaTeX."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from labcrane.analysis.report.factors import DISTANCE, GROUP, PHASE, PLACE, Factors
from labcrane.analysis.report.findings import Results, StudyFinding, lacking
from labcrane.analysis.report.outcomes import OCCASION, Test
from labcrane.analysis.statistics.anova import Anova, Contrast
from labcrane.analysis.statistics.trends import Trend

if TYPE_CHECKING:
    import pandas as pd

LEVEL = 0.05
"""Level of significance, in the words only; p is always given."""

NAMES = {
    "movement_time": "Movement time, from onset to offset,",
    "onset_to_rest": "The time from onset to rest",
    "circle_to_circle": "The time from circle to circle, with reaction and dwell,",
    "absolute_error": "The distance from the target's centre",
    "constant_error": "The signed error along the task axis",
    "reaction_time": "Reaction time",
    "path_length": "The length of the path",
    "sparc": "SPARC, the smoothness of the tip's speed,",
    "ldlj": "LDLJ, the smoothness of the tip's jerk,",
}
LOOKED = {
    "dwell_before_": "How long {} was looked at before onset",
    "dwell_during_": "How long {} was looked at during movements",
    "look_lead_": "How long before onset {} was looked at first",
}
ANALYSES = ("anova", "gaze_tests", "score_tests")
"""Tables of analyses of variance whose tests are in the words."""

SMALLEST = 0.001

ROUNDING = 1e-9
"""Share of an interval; a smaller estimate is what rounding leaves of zero."""

UNTESTED = "was not tested by an analysis of variance"

UNBALANCED = (
    "Sessions do not have the same blocks: each block of each session is a level of one factor, "
    "phase, and effects of session and block cannot be separated"
)


@dataclass(frozen=True, slots=True)
class Style:
    """How a format writes symbols.

    Attributes
    ----------
    symbol
        Writes the name of a statistic: ``F``, ``p``.
    eta
        Partial eta squared.
    minus, percent, less
        A minus sign before a number, a per cent sign and a less-than sign.
    plain
        Writes any other text.
    """

    symbol: Callable[[str], str]
    eta: str
    minus: str
    percent: str
    less: str
    plain: Callable[[str], str]


TEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        **{sign: f"\\{sign}" for sign in "&%$#_{}"},
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "°": r"\textdegree{}",
        "²": r"\textsuperscript{2}",
    }
)
MARKS = str.maketrans({sign: f"\\{sign}" for sign in "\\`*_[]<>#|~"})

STYLES: Mapping[str, Style] = {
    "html": Style(str, "ηp²", "\N{MINUS SIGN}", "%", "<", str),
    "md": Style(
        lambda name: f"*{name}*",
        "*η*<sub>p</sub>²",
        "\N{MINUS SIGN}",
        "%",
        "&lt;",
        lambda text: text.translate(MARKS),
    ),
    "tex": Style(
        lambda name: f"${name}$",
        r"$\eta_p^2$",
        "$-$",
        r"\%",
        "$<$",
        lambda text: text.translate(TEX),
    ),
}


def paragraphs(results: Results, style: Style) -> list[str]:
    """Return the results as paragraphs in one format."""
    found = [style.plain(results.sample) + " " + _given_up(results.time_outs, style)]
    if results.factors.unbalanced:
        found[0] += f" {UNBALANCED}."
    if results.factors.uneven:
        found[0] += f" {style.plain(results.factors.uneven)}"
    asked = results.factors.questions
    for measure in results.measures(*ANALYSES):
        own = results.of(measure)
        name = style.plain(NAMES.get(measure, _looked(measure)))
        others = depends(own, results.factors)
        sentences = [
            _effect(one.test, style, results.people) + style.plain(others.get(one.effect, ""))
            for one in sorted(own, key=lambda one: one.effect not in asked)
            if one.table in ANALYSES and isinstance(one.test, Anova)
        ]
        more = [
            said
            for table in ("trends", "time_scales", "contrasts")
            for one in own
            if one.table == table and (said := _sentence(one.test, style, results))
        ]
        text = "; ".join(sentences) or UNTESTED
        found.append(" ".join([f"{name} {text}.", *shortfalls(own, style), *more]))
    return found


def _sentence(test: Test | None, style: Style, results: Results) -> str:
    """Return a test that is not an analysis of variance in a sentence; empty if there is none."""
    match test:
        case Trend():
            return _trend(test, style, results)
        case Contrast():
            return _contrast(test, style, results)
        case Mapping():
            return _scale(test, style, results)
    return ""


def shortfalls(findings: Iterable[StudyFinding], style: Style) -> list[str]:
    """Return sentences on what a measure's tests lack: each reason once."""
    factors: dict[tuple[str, str], list[str]] = {}
    for one in lacking(findings):
        for short in one.short:
            factors.setdefault((short.without, short.why), []).append(one.effect)
    found = []
    for (without, why), names in factors.items():
        over = ", ".join(map(_spoken, sorted(names, key=lambda name: ":" in name)))
        begin = f"Without {without}, tested" if without else "Not tested"
        found.append(style.plain(f"{begin} over {over}: {why}."))
    return found


def _spoken(effect: str) -> str:
    """Return a main effect by its factor, and an interaction as one."""
    names = " and ".join(effect.split(":"))
    return f"the interaction of {names}" if ":" in effect else names


def of_people(n: int, style: Style, people: int) -> str:
    """Return ``, n = 33 of 36 people`` where a test is not of the whole sample."""
    return "" if n == people else f", {style.symbol('n')} = {n} of {people} people"


def _looked(outcome: str) -> str:
    """Return a measure of gaze as the beginning of a sentence; any other as it is."""
    for start, words in LOOKED.items():
        if outcome.startswith(start):
            return words.format(outcome.removeprefix(start))
    return outcome


def _given_up(table: "pd.DataFrame", style: Style) -> str:
    trials, out = int(table["trials"].sum()), int(table["time_outs"].sum())
    others = int(table["others"].sum())
    share = f" ({100.0 * out / trials:.1f} {style.percent})" if trials else ""
    told = f"Of {trials} trials, {out}{share} ended by time-out"
    told += f" and {others} in another way, without success or without an onset." if others else "."
    rows = [
        {str(name): value for name, value in row.items()}
        for row in table[table["time_outs"] > 0].to_dict("records")
    ]
    if not rows:
        return told
    told += (
        " Means of successes alone look fast; in the medians time-outs are censored at the limit"
    )
    return f"{told}: {'; '.join(_slow(row, style) for row in rows)}."


def _slow(row: Mapping[str, Any], style: Style) -> str:
    """Return the time-outs of one condition, and its mean and median time."""
    where = [style.plain(str(row[name])) for name in (GROUP, PHASE) if row.get(name)]
    if "distance" in row:
        where.append(f"{row['distance']:g} m")
    middle, mean = row["median_with_time_outs_s"], row["mean_of_successes_s"]
    median = "over half given up" if math.isnan(middle) else f"median {middle:.3g} s"
    successes = "no success" if math.isnan(mean) else f"mean of successes {mean:.3g} s"
    return f"{', '.join(where)}: {row['time_outs']} of {row['trials']}, {successes}, {median}"


def f_test(test: Anova, style: Style, people: int) -> str:
    """Return ``F(5.27, 184.33) = 2.43, p = .034, ηp² = .06``, corrected where it matters.

    The number of participants follows if not all of the sample are in it.
    """
    whole = test.epsilon == 1.0
    df = [test.epsilon * test.df1, test.epsilon * test.df2]
    free = ", ".join(f"{value:.0f}" if whole else f"{value:.2f}" for value in df)
    return (
        f"{style.symbol('F')}({free}) = {test.f:.2f}, {_p(test.p_gg, style)}, "
        f"{style.eta} = {_share(test.eta2p, 2)}{of_people(test.n, style, people)}{_period(test)}"
    )


def _period(test: Anova | Contrast) -> str:
    """Return ``, period taken out`` of a test of conditions, with blocks or occasions adjusted."""
    return ", period taken out" if test.beside in {PHASE, OCCASION} else ""


def verdict(test: Anova, style: Style) -> str:
    """Return ``differed over distance``, or ``showed an interaction of group and block``."""
    effect, _, rest = test.factor.partition(" ")
    names = style.plain(" and ".join(effect.split(":")) + (f" {rest}" if rest else ""))
    if ":" in effect:
        said = "showed an" if test.p_gg < LEVEL else "showed no detectable"
        return f"{said} interaction of {names}"
    return f"{'differed' if test.p_gg < LEVEL else 'did not detectably differ'} over {names}"


def level(column: str, name: str) -> str:
    """Return a level of a factor as sentences name it: ``position 3``, ``2 m``."""
    return f"position {name}" if column == PLACE else f"{name} m" if column == DISTANCE else name


def depends(findings: Iterable[StudyFinding], factors: Factors) -> dict[str, str]:
    """Return what to add to each main effect whose factor is in an interaction that was found.

    Of the interactions that the design asks about only: among all, some would be found by chance.
    """
    others: dict[str, list[str]] = {}
    for one in findings:
        test = one.test
        if one.table not in ANALYSES or one.effect not in factors.questions:
            continue
        if isinstance(test, Anova) and test.p_gg < LEVEL and not test.confounded:
            parts = one.effect.split(":")
            for part in parts:
                others.setdefault(part, []).extend(other for other in parts if other != part)
    return {
        name: f", on average: it depends on {' and '.join(dict.fromkeys(found))}"
        for name, found in others.items()
    }


def _effect(test: Anova, style: Style, people: int) -> str:
    return f"{verdict(test, style)}{_confounded(test.confounded)}, {f_test(test, style, people)}"


def changed(estimate: float, p: float) -> str:
    """Return ``fell by`` or ``rose by`` of a change that was found, by its corrected p."""
    if not p < LEVEL:
        return "did not detectably change:"
    return "fell by" if estimate < 0 else "rose by"


def _trend(trend: Trend, style: Style, results: Results) -> str:
    corrected = not math.isnan(trend.p_holm)
    holm = f" (after Holm {_p(trend.p_holm, style)})" if corrected else ""
    said = changed(trend.slope, trend.p_holm if corrected else trend.p)
    low, high = (_number(end, style) for end in trend.slope_ci)
    widest = max(map(abs, trend.slope_ci))
    slope = 0.0 if abs(trend.slope) < ROUNDING * widest else trend.slope
    number = _number(slope, style) if said.endswith(":") else f"{abs(slope):.3g}"
    tested = f"{_t(trend.t, trend.df, trend.p, style)}{holm}"
    return (
        f"Over the positions of {style.plain(trend.phase)}{_confounded(trend.confounded)} it "
        f"{said} {results.quantity(number, trend.measure)} each, 95 {style.percent} CI "
        f"[{low}, {high}], {tested}{of_people(trend.n, style, results.people)}."
    )


def _scale(row: Mapping[str, Any], style: Style, results: Results) -> str:
    """Return the changes within a phase and from one to the next, over all participants."""
    spoken = {
        "slope": "Change with each position of",
        "change": "Mean change to",
        "difference score": "Difference score from the last position to the first of",
        "net gain": "Net gain from last position to last position, to",
    }
    if row["group"] != "all" or row["quantity"] not in spoken:
        return ""
    mean = results.quantity(_number(row["mean"], style), row["measure"])
    said = f"{spoken[row['quantity']]} {style.plain(str(row['phase']))}"
    if row["why"]:
        return f"{said}: not tested, {row['why']}."
    said += _confounded(row["confounded"])
    said += ", averaged over people" if results.factors.groups else ""
    said += f", with {row['adjustment']}:" if row["adjustment"] else ":"
    tested = (
        f"{_t(row['t'], row['df'], row['p'], style)}{of_people(row['n'], style, results.people)}"
    )
    return f"{said} {mean}, {tested}."


def _contrast(one: Contrast, style: Style, results: Results) -> str:
    if math.isnan(one.t):
        return ""  # all are alike
    at = f" in {style.plain(one.at)}" if one.at else ""
    at += _confounded(one.confounded)
    first, second = (style.plain(level(one.factor, name)) for name in (one.first, one.second))
    difference = results.quantity(_number(one.difference, style), one.measure)
    low, high = _number(one.ci_low, style), _number(one.ci_high, style)
    return (
        f"{first} minus {second}{at}: {difference}, "
        f"95 {style.percent} CI [{low}, {high}], {style.symbol('t')}({one.df:.0f}) = "
        f"{_number(one.t, style, '.2f')}, Holm-corrected {_p(one.p_holm, style)}"
        f"{of_people(one.n, style, results.people)}{_period(one)}."
    )


def _confounded(words: str) -> str:
    """Return `` (cannot be distinguished from positions)`` where an effect is confounded."""
    return f" (cannot be distinguished from {words})" if words else ""


def _t(t: float, df: float, p: float, style: Style) -> str:
    return f"{style.symbol('t')}({df:.0f}) = {_number(t, style, '.2f')}, {_p(p, style)}"


def _number(value: float, style: Style, spec: str = ".3g") -> str:
    return (style.minus if value < 0 else "") + format(abs(value), spec)


def _p(p: float, style: Style) -> str:
    if p < SMALLEST:
        return f"{style.symbol('p')} {style.less} .001"
    return f"{style.symbol('p')} = {_share(p, 3)}"


def _share(value: float, digits: int) -> str:
    """Return a number that cannot be above 1 as papers do, without the zero before the point."""
    text = f"{value:.{digits}f}"
    return text.removeprefix("0")
