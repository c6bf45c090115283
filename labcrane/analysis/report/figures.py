"""The report's figures, each with the table it shows."""

from collections.abc import Callable
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from labcrane.analysis.report.factors import CONDITION
from labcrane.analysis.report.sample import counted
from labcrane.analysis.report.style import COLOURS, HIGH, MARKERS, PAGE, new_figure, styled
from labcrane.analysis.statistics.fitts import Regression, mean_line, regress
from labcrane.analysis.statistics.learning import CURVES
from labcrane.analysis.statistics.trends import LEAST
from labcrane.analysis.tables.load import FEWEST
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WORDS = {
    "movement_time": "movement time (s)",
    "onset_to_rest": "time from onset to rest (s)",
    "circle_to_circle": "time from circle to circle (s)",
    "absolute_error": "distance from the target's centre (m)",
    "simultaneous": "time with two or more axes (fraction)",
    "bimanual": "time with both sticks (fraction)",
    "reversals": "stick reversals (1/s)",
    "sparc": "smoothness (SPARC)",
}

FRACTION = (-0.03, 1.03)
"""Range of an axis of fractions, which are 0 to 1."""

PLACE_WORDS = "position in the sequence"
MEANS = (
    "Points: means over participants' means, bars: 95 % confidence intervals (t) for three or "
    "more participants,"
)
MOST_NAMED = 60
"""Maximum number of participants with names in a figure; more would fill a page."""

LINE = 0.13
"""Inches from one name to the next."""


GREY, FAINT = "#999999", "#c7c7c7"
"""Of dots, and of thin lines behind everything else."""

WORDS_A_LINE = 30
"""Letters of an axis' name beside a figure of one column: longer ones go into two lines."""

ROW, HEAD = 0.8, 0.7
"""Height of a row of the figure of load, and of all else in it, in inches."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure, its file name, its caption, and its table."""

    name: str
    caption: str
    figure: "Figure"
    table: "pd.DataFrame"


def over(movements: "pd.DataFrame", measure: str, by: list[str]) -> "pd.DataFrame":
    """Return mean, 95 % confidence interval and n over participants' means, for each level."""
    import pandas as pd
    from scipy.stats import t

    cells = movements.groupby([*by, "participant"])[measure].mean().dropna()
    rows = []
    for level, values in cells.groupby(level=list(range(len(by)))):
        n, mean = len(values), float(values.mean())
        spread = float(values.std(ddof=1)) / np.sqrt(n) if n > 1 else np.nan
        reach = float(t.ppf(0.975, n - 1)) * spread if n > 1 else np.nan
        rows.append((*cast("tuple[Any, ...]", level), mean, mean - reach, mean + reach, n))
    columns = [*by, "mean", "ci_low", "ci_high", "participants"]
    return pd.DataFrame(rows, columns=columns)


@styled()
def by_sequence(
    movements: "pd.DataFrame", measure: str, tested: "pd.DataFrame | None" = None
) -> Drawing:
    """Draw a measure over the sequence: participants thin, the mean of each group thick.

    Parameters
    ----------
    tested
        Movements of those in the test over the sequence, for the means; by default, or if nobody
        is in the test, those of all.
    """
    few = tested is not None and 0 < len(tested) < len(movements)
    whose = tested if few and tested is not None else movements
    figure = new_figure()
    (axes,) = figure.axes
    _thin(axes, movements, measure)
    groups = movements["group"].nunique() > 1
    by = ["group", "sequence"] if groups else ["sequence"]
    table = over(whose, measure, by)
    for number, (name, part) in enumerate(table.groupby("group") if groups else [("", table)]):
        for at, own in enumerate(_by_phase(movements, part)):
            _with_ci(axes, own, number, str(name) if at == 0 else "")
    _name(axes, measure)
    _legend(figure, "group")
    caption = (
        f"{_begun(WORDS.get(measure, measure))}, over the sequence. {MEANS} of "
        f"{_of(whose, 'group' if groups else '')}{', those who are tested' if few else ''}"
        f"{_at(table)}; thin lines: each of {_all(movements)}."
    )
    return Drawing(f"{measure}_by_sequence", caption, figure, table)


def _thin(axes: "Axes", movements: "pd.DataFrame", measure: str) -> None:
    """Draw a line for each participant."""
    each = movements.groupby(["participant", "sequence"])[measure].mean().unstack(level=0)
    for who in each:
        axes.plot(_numbers(each.index), _numbers(each[who]), color=FAINT, lw=0.5)


def _by_phase(movements: "pd.DataFrame", table: "pd.DataFrame") -> "list[pd.DataFrame]":
    """Return a table cut where a session or block ends: no line leads from one into the next."""
    phases = movements.groupby("sequence")["phase"].first()
    return [part for _, part in table.groupby(table["sequence"].map(phases))]


@styled()
def by_distance(movements: "pd.DataFrame") -> Drawing:
    """Draw times and accuracy over the sequence for each distance."""
    import pandas as pd

    shown = [
        name
        for name in ("circle_to_circle", "movement_time", "absolute_error")
        if name in movements and movements[name].notna().any()
    ]
    figure, tables = new_figure(len(shown)), []
    for at, (axes, measure) in enumerate(zip(figure.axes, shown, strict=True)):
        table = over(movements, measure, ["distance", "sequence"])
        own = movements.groupby(["distance", "participant", "sequence"])[measure].mean()
        levels = list(table.groupby("distance"))
        for number, (distance, _) in enumerate(levels):
            each, colour = own.loc[distance].reset_index(), COLOURS[number % len(COLOURS)]
            where = _numbers(each["sequence"]) + _aside(number, len(levels))
            axes.plot(where, _numbers(each[measure]), ".", color=lighter(colour), lw=0.8)
        for number, (distance, part) in enumerate(levels):
            beside = part.assign(sequence=part["sequence"] + _aside(number, len(levels)))
            _with_ci(axes, beside, number, "" if at else f"{distance:g} m")
        _name(axes, measure)
        axes.set_ylim(*_range(own))
        tables.append(table.assign(measure=measure))
    _legend(figure, "distance")
    caption = (
        f"Times and accuracy over the sequence, for each distance. {MEANS} of {_of(movements)}"
        f"{_at(pd.concat(tables))}, "
        "side by side to be distinguishable; dots: each participant. An interval of few "
        "participants may be wider than the figure shows."
    )
    return Drawing("sequence_by_distance", caption, figure, pd.concat(tables))


@styled()
def fitts(movements: "pd.DataFrame") -> Drawing:
    """Draw movement time over difficulty, with the mean of the participants' regressions."""
    import pandas as pd

    cells = movements.groupby(["participant", "difficulty"])["movement_time"].mean().reset_index()
    x, y = _numbers(cells["difficulty"]), _numbers(cells["movement_time"])
    figure, law = new_figure(), ""
    (axes,) = figure.axes
    axes.plot(x, y, ".", color=GREY, lw=0.8)
    lines = {
        str(participant): regress(_numbers(own["difficulty"]), _numbers(own["movement_time"]))
        for participant, own in movements.groupby("participant")
    }
    whole = mean_line([line for line in lines.values() if line is not None])
    rows = [_line(*each) for each in [*lines.items(), ("mean of participants' lines", whole)]]
    if whole is not None:
        ends = np.array([x.min(), x.max()])
        axes.plot(ends, whole.intercept + whole.slope * ends, color=COLOURS[0], lw=0.8)
        low, high = whole.slope_ci
        law = (
            f" Line: the mean of {whole.n} participants' lines, {whole.intercept:.2f} s + "
            f"{whole.slope:.2f} s/bit (95 % interval over people {low:.2f} to {high:.2f})."
        )
    _name(axes, "movement_time", "index of difficulty (bit)")
    caption = (
        f"Fitts' law: movement time over the index of difficulty. Dots: each participant's mean at "
        f"each difficulty, {_of(movements)}.{law}"
    )
    return Drawing("fitts", caption, figure, pd.DataFrame(rows))


def _numbers(column: "pd.Series[Any] | pd.Index[Any]") -> FloatArray:
    return np.asarray(column, np.float64)


def _line(who: str, fit: Regression | None) -> dict[str, object]:
    if fit is None:
        return {"participant": who}
    return {
        "participant": who,
        "intercept_s": fit.intercept,
        "intercept_low": fit.intercept_ci[0],
        "intercept_high": fit.intercept_ci[1],
        "slope_s_bit": fit.slope,
        "slope_low": fit.slope_ci[0],
        "slope_high": fit.slope_ci[1],
        "r2": fit.r2,
        "n": fit.n,
    }


@styled()
def learning(movements: "pd.DataFrame", curves: "pd.DataFrame", measure: str) -> Drawing:
    """Draw participants' means and the better of both learning curves for each.

    Curves count from the first position of their session or block. With too few positions to
    compare the curves, only means are drawn.
    """
    figure = new_figure()
    (axes,) = figure.axes
    fitted_to = curves[curves["measure"] == measure]
    people = {name: number for number, name in enumerate(fitted_to["participant"].unique())}
    best = fitted_to.sort_values("better").drop_duplicates(["participant", "phase"], keep="last")
    drawn = 0
    for row in best.itertuples(index=False):
        own = movements[movements["participant"] == row.participant]
        own = own[own["phase"] == row.phase]
        means = own.groupby("sequence")[measure].mean()
        colour = COLOURS[people[row.participant] % len(COLOURS)]
        axes.plot(_numbers(means.index), _numbers(means), ".", color=colour, lw=0.8)
        if row.better == "no":
            continue
        drawn += 1
        before = float((own["sequence"] - own["place"]).iloc[0])
        n = np.linspace(1, float(means.index.max()) - before, 100)
        curve: Callable[..., np.ndarray] = CURVES[str(row.curve)]
        fitted = curve(n, row.asymptote, row.gain, row.rate)
        axes.plot(n + before, fitted, color=colour, lw=0.8)
    _name(axes, measure)
    caption = (
        f"Learning curves of {_begun(WORDS.get(measure, measure)).lower()}. Dots: each "
        f"participant's means, n = {counted(len(people), 'participant')}; lines: the better of an "
        "exponential and a power curve"
        + ("." if drawn else ", which cannot be fitted to so few positions.")
    )
    return Drawing(f"learning_{measure}", caption, figure, curves)


@styled()
def sticks(movements: "pd.DataFrame") -> Drawing:
    """Draw how the sticks were used over the sequence."""
    import pandas as pd

    measures, tables = ("simultaneous", "bimanual", "reversals"), []
    figure = new_figure(len(measures))
    for axes, measure in zip(figure.axes, measures, strict=True):
        table = over(movements, measure, ["sequence"])
        _thin(axes, movements, measure)
        _with_ci(axes, table, 0)
        _name(axes, measure)
        if measure != "reversals":
            axes.set_ylim(*FRACTION)
        tables.append(table.assign(measure=measure))
    caption = (
        f"Use of the sticks over the sequence. {MEANS} of {_of(movements)}"
        f"{_at(pd.concat(tables))}; thin lines: each participant."
    )
    return Drawing("sticks", caption, figure, pd.concat(tables))


@styled()
def throughputs(table: "pd.DataFrame") -> Drawing:
    """Draw each participant's throughput, the least at the bottom, each on a line of its own."""
    mean, own = float(table["throughput"].mean()), table.sort_values("throughput")
    named = len(own) <= MOST_NAMED
    figure = new_figure(high=max(HIGH, LINE * len(own) + 0.6) if named else HIGH)
    (axes,) = figure.axes
    places = np.arange(len(own))
    axes.plot(own["throughput"], places, "o", color=COLOURS[0])
    axes.set_yticks(places if named else [], own["participant"] if named else [])
    axes.axvline(float(own["throughput"].mean()), color="k", lw=0.8)
    axes.set(xlabel="throughput (bit/s)", ylabel="participant")
    caption = (
        f"Throughput: mean over distances and widths of targets. Dots: each participant, "
        f"n = {counted(len(table), 'participant')}; "
        f"line: their mean, {mean:.3f} bit/s."
    )
    return Drawing("throughput", caption, figure, table)


def _range(values: "pd.Series[float]") -> tuple[float, float]:
    """Return the range of the values: an interval of two people would compress the figure."""
    low, high = float(values.min()), float(values.max())
    aside = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return low - aside, high + aside


def _begun(words: str) -> str:
    return words[:1].upper() + words[1:].partition(" (")[0]


def _of(movements: "pd.DataFrame", by: str = "") -> str:
    """Return the number of participants, and their group."""
    said = f"n = {_all(movements)}"
    if not by:
        return said
    sizes = movements.groupby(by)["participant"].nunique()
    return f"{said} ({', '.join(f'{size} {name}' for name, size in sizes.items())})"


def _all(movements: "pd.DataFrame") -> str:
    return counted(int(movements["participant"].nunique()), "participant")


def _at(table: "pd.DataFrame") -> str:
    """Return the numbers of participants per point, where they differ."""
    fewest, most = int(table["participants"].min()), int(table["participants"].max())
    return "" if fewest == most else f", {fewest} to {most} in a point"


def _aside(number: int, count: int) -> float:
    """Return the offset of a level from its position, so that bars do not cover each other."""
    return 0.12 * (number - (count - 1) / 2.0)


def _with_ci(axes: "Axes", table: "pd.DataFrame", number: int, label: str = "") -> None:
    """Draw means of a level over the sequence, with their intervals."""
    below, above = table["mean"] - table["ci_low"], table["ci_high"] - table["mean"]
    few = np.asarray(table["participants"], float) < LEAST  # the bar of two is of their difference
    axes.errorbar(
        _numbers(table["sequence"]),
        _numbers(table["mean"]),
        np.where(few, 0.0, np.nan_to_num(np.array([below, above], float))),
        capsize=1.5,
        label=label or None,
        color=COLOURS[number % len(COLOURS)],
        marker=MARKERS[number % len(MARKERS)],
        linestyle="-",
    )


def _name(axes: "Axes", measure: str, across: str = PLACE_WORDS) -> None:
    up = WORDS.get(measure, measure)
    axes.set(xlabel=across, ylabel=fill(up, WORDS_A_LINE))


def _legend(figure: "Figure", title: str) -> None:
    """Add a legend of all axes above them, where anything has a label."""
    named = [
        each for axes in figure.axes for each in zip(*axes.get_legend_handles_labels(), strict=True)
    ]
    if named:
        handles, labels = zip(*named, strict=True)
        figure.legend(handles, labels, title=title, loc="outside upper center", ncols=4)


def lighter(colour: str) -> str:
    """Return a colour as it looks at a third of its strength on white."""
    parts = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return "#" + "".join(f"{255 - (255 - part) // 3:02x}" for part in parts)


@styled()
def power_curve(table: "pd.DataFrame", whose: str) -> "Figure":
    """Return the power over the cohort size, with the rate of false positives.

    ``whose`` names the participants whom cohorts are sampled from.
    """
    figure = new_figure()
    (axes,) = figure.axes
    for name, words in (("power", "with the effect"), ("null", "labels permuted")):
        low, high = table[name] - table[f"{name}_low"], table[f"{name}_high"] - table[name]
        axes.errorbar(
            table["participants"], table[name], [low, high], marker="o", capsize=3, label=words
        )
    axes.axhline(0.8, color="0.6", linestyle="--", linewidth=1)
    axes.axhline(0.05, color="0.6", linestyle=":", linewidth=1)
    axes.set(xlabel="participants", ylabel="share of cohorts with p < 0.05", ylim=FRACTION)
    axes.set_title(whose, fontsize="medium")
    axes.set_xticks(table["participants"])
    axes.legend(loc="center right")
    return figure


@styled()
def load(table: "pd.DataFrame") -> Drawing:
    """Draw :func:`~labcrane.analysis.tables.load.load_table`.

    A row for each person, a column for each measure, conditions from left to right.
    """
    from matplotlib.figure import Figure

    people = list(dict.fromkeys(table["participant"].sort_values()))
    measures = list(dict.fromkeys(table["measure"]))
    levels = sorted(set(table[CONDITION]))
    figure = Figure((PAGE, ROW * len(people) + HEAD), layout="constrained")
    grid = figure.subplots(len(people), len(measures), sharex=True, sharey="col", squeeze=False)
    for person, row in zip(people, grid, strict=True):
        for measure, axes in zip(measures, row, strict=True):
            own = table[(table["participant"] == person) & (table["measure"] == measure)]
            x = np.array([levels.index(each) for each in own[CONDITION]])
            ends = own["mean"] - own["ci_low"], own["ci_high"] - own["mean"]
            reach = np.nan_to_num(np.maximum(ends, 0.0))
            axes.errorbar(x, own["mean"], reach, fmt="o", color=COLOURS[0], elinewidth=0.8)
            axes.set_xlim(-0.5, len(levels) - 0.5)
            axes.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel(person, rotation=0, ha="right", fontsize=6.0)
    for measure, axes in zip(measures, grid[0], strict=True):
        axes.set_title(measure.replace("_", "\n", 1), fontsize=6.5)
    for axes in grid[-1]:
        axes.set_xticks(range(len(levels)), levels, rotation=45, ha="right", fontsize=6.0)
    caption = (
        "Measures of load by condition, one row per person. Points: means of a person's movements, "
        f"bars: 95 % confidence intervals (t) over {FEWEST} or more movements; hit rates are of "
        "all stimuli, with Wilson's interval. A questionnaire that was asked once has none."
    )
    return Drawing("load", caption, figure, table)
