"""Results in APA style, in HTML, Markdown and LaTeX."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from labcrane.analysis.report.factors import GROUP, PHASE, Factors
from labcrane.analysis.report.outcomes import questions

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
SMALLEST = 0.001

ROUNDING = 1e-9
"""Share of an interval; a smaller estimate is what rounding leaves of zero."""

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


@dataclass(frozen=True, slots=True)
class Results:
    """Results to put into words.

    Attributes
    ----------
    sample
        The sample in a sentence.
    anova, contrasts, trends, scales, gaze, scores
        The report's tables; empty ones add no text.
    time_outs
        Counts by condition.
    factors
        Factors of the study.
    people
        Participants of the sample; a test of others gives its own number.
    shortfalls
        Shortfalls of planned tests.
    primary
        Outcomes that the protocol names as primary.
    units
        Of the measures, by name; "1" and "" are none.
    """

    sample: str
    anova: "pd.DataFrame"
    contrasts: "pd.DataFrame"
    trends: "pd.DataFrame"
    scales: "pd.DataFrame"
    gaze: "pd.DataFrame"
    scores: "pd.DataFrame"
    time_outs: "pd.DataFrame"
    factors: Factors
    people: int
    shortfalls: "pd.DataFrame"
    primary: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def quantity(self, number: str, measure: str) -> str:
        """Return a number of a measure with its unit, if it has one."""
        unit = self.units.get(measure, "")
        return number if unit in {"", "1"} else f"{number} {unit}"


def paragraphs(results: Results, style: Style) -> list[str]:
    """Return the results as paragraphs in one format."""
    found = [style.plain(results.sample) + " " + _given_up(results.time_outs, style)]
    if results.factors.unbalanced:
        found[0] += f" {UNBALANCED}."
    if results.factors.uneven:
        found[0] += f" {style.plain(results.factors.uneven)}"
    tests = (results.anova, results.gaze, results.scores, results.shortfalls)
    asked = [":".join(names) for names, _ in questions(results.factors)]
    for measure in dict.fromkeys(name for table in tests for name in _measures(table)):
        effects = [row for table in tests[:3] for row in rows_of(table, measure)]
        effects.sort(key=lambda row: row["factor"] not in asked)
        name, others = style.plain(NAMES.get(measure, _looked(measure))), depends(effects)
        sentences = [
            _effect(row, style, results.people) + style.plain(others.get(row["factor"], ""))
            for row in effects
        ]
        text = "; ".join(sentences) or "was not tested by an analysis of variance"
        more = lacking(results.shortfalls, measure, style)
        for table, words in (
            (results.trends, _trend), (results.scales, _scale), (results.contrasts, _contrast),
        ):  # fmt: skip
            more += [words(row, style, results) for row in rows_of(table, measure)]
        found.append(" ".join([f"{name} {text}.", *filter(None, more)]))
    return found


def lacking(shortfalls: "pd.DataFrame", measure: str, style: Style) -> list[str]:
    """Return sentences on the shortfalls of a measure's tests: each reason once."""
    factors: dict[tuple[str, str], list[str]] = {}
    for row in rows_of(shortfalls, measure):
        factors.setdefault((str(row["without"]), str(row["why"])), []).append(str(row["factor"]))
    found = []
    for (without, why), names in factors.items():
        over = ", ".join(" and ".join(name.split(":")) for name in names)
        begin = f"Without {without}, tested" if without else "Not tested"
        found.append(style.plain(f"{begin} over {over}: {why}."))
    return found


def of_people(row: Mapping[str, Any], style: Style, people: int) -> str:
    """Return ``, n = 33 of 36 people`` where a test is not of the whole sample."""
    number = int(row["n"])
    return "" if number == people else f", {style.symbol('n')} = {number} of {people} people"


def _looked(outcome: str) -> str:
    """Return a measure of gaze as the beginning of a sentence; any other as it is."""
    for start, words in LOOKED.items():
        if outcome.startswith(start):
            return words.format(outcome.removeprefix(start))
    return outcome


def rows_of(table: "pd.DataFrame", measure: str) -> list[dict[str, Any]]:
    """Return a measure's rows of a table."""
    if not len(table):
        return []
    rows = table[table["measure"] == measure].to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in rows]


def _measures(table: "pd.DataFrame") -> list[str]:
    return list(map(str, table["measure"].unique())) if len(table) else []


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


def f_test(row: Mapping[str, Any], style: Style, people: int) -> str:
    """Return ``F(5.27, 184.33) = 2.43, p = .034, ηp² = .06``, corrected where it matters.

    The number of participants follows if not all of the sample are in it.
    """
    whole = row["epsilon"] == 1.0
    df = [row["epsilon"] * row["df1"], row["epsilon"] * row["df2"]]
    free = ", ".join(f"{value:.0f}" if whole else f"{value:.2f}" for value in df)
    return (
        f"{style.symbol('F')}({free}) = {row['f']:.2f}, {_p(row['p_gg'], style)}, "
        f"{style.eta} = {_share(row['eta2p'], 2)}{of_people(row, style, people)}"
    )


def verdict(row: Mapping[str, Any], style: Style) -> str:
    """Return ``differed over distance``, or ``showed an interaction of group and block``."""
    effect, _, rest = str(row["factor"]).partition(" ")
    names = style.plain(" and ".join(effect.split(":")) + (f" {rest}" if rest else ""))
    if ":" in effect:
        said = "showed an" if row["p_gg"] < LEVEL else "showed no detectable"
        return f"{said} interaction of {names}"
    return f"{'differed' if row['p_gg'] < LEVEL else 'did not detectably differ'} over {names}"


def depends(tests: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return what to add to each main effect whose factor is in an interaction that was found."""
    others: dict[str, list[str]] = {}
    for row in tests:
        parts = str(row["factor"]).partition(" ")[0].split(":")
        if len(parts) > 1 and row["p_gg"] < LEVEL and not row.get("confounded"):
            for part in parts:
                others.setdefault(part, []).extend(other for other in parts if other != part)
    return {
        name: f", on average: it depends on {' and '.join(dict.fromkeys(found))}"
        for name, found in others.items()
    }


def _effect(row: Mapping[str, Any], style: Style, people: int) -> str:
    return f"{verdict(row, style)}{_confounded(row)}, {f_test(row, style, people)}"


def changed(estimate: float, p: float) -> str:
    """Return ``fell by`` or ``rose by`` of a change that was found, by its corrected p."""
    if not p < LEVEL:
        return "did not detectably change:"
    return "fell by" if estimate < 0 else "rose by"


def _trend(row: Mapping[str, Any], style: Style, results: Results) -> str:
    phase = next((str(row[kind]) for kind in ("session", "block", "phase") if kind in row), "")
    corrected = not math.isnan(row["p_holm"])
    holm = f" (after Holm {_p(row['p_holm'], style)})" if corrected else ""
    said = changed(row["slope"], row["p_holm"] if corrected else row["p"])
    low, high = _number(row["slope_low"], style), _number(row["slope_high"], style)
    widest = max(abs(row["slope_low"]), abs(row["slope_high"]))
    slope = 0.0 if abs(row["slope"]) < ROUNDING * widest else row["slope"]
    number = _number(slope, style) if said.endswith(":") else f"{abs(slope):.3g}"
    return (
        f"Over the positions of {style.plain(phase)}{_confounded(row)} it {said} "
        f"{results.quantity(number, row['measure'])} each, 95 {style.percent} CI [{low}, {high}], "
        f"{_t(row, style)}{holm}{of_people(row, style, results.people)}."
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
    said += _confounded(row)
    said += f", with {row['adjustment']}:" if row["adjustment"] else ":"
    return f"{said} {mean}, {_t(row, style)}{of_people(row, style, results.people)}."


def _contrast(row: Mapping[str, Any], style: Style, results: Results) -> str:
    if math.isnan(row["t"]):
        return ""  # all are alike
    at = f" in {style.plain(str(row['at']))}" if row["at"] else ""
    at += _confounded(row)
    first, second = style.plain(str(row["first"])), style.plain(str(row["second"]))
    difference = results.quantity(_number(row["difference"], style), row["measure"])
    if row["factor"] == "distance":
        first, second = f"{first} m", f"{second} m"
    low, high = _number(row["ci_low"], style), _number(row["ci_high"], style)
    return (
        f"{first} minus {second}{at}: {difference}, "
        f"95 {style.percent} CI [{low}, {high}], {style.symbol('t')}({row['df']:.0f}) = "
        f"{_number(row['t'], style, '.2f')}, Holm-corrected {_p(row['p_holm'], style)}"
        f"{of_people(row, style, results.people)}."
    )


def _confounded(row: Mapping[str, Any]) -> str:
    """Return `` (cannot be distinguished from positions)`` where an effect is confounded."""
    return f" (cannot be distinguished from {row['confounded']})" if row.get("confounded") else ""


def confounding(anova: "pd.DataFrame") -> list[str]:
    """Return a sentence for each confound that factors cannot be distinguished from."""
    rows = anova[anova["confounded"] != ""].drop_duplicates(["factor", "confounded"])
    return [
        f"The effect{'s' * (len(own) > 1)} of {' and '.join(own['factor'])} cannot be "
        f"distinguished from {words}: in these orders, either may have caused the difference."
        for words, own in rows.groupby("confounded")
    ]


def _t(row: Mapping[str, Any], style: Style) -> str:
    value = _number(row["t"], style, ".2f")
    return f"{style.symbol('t')}({row['df']:.0f}) = {value}, {_p(row['p'], style)}"


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
