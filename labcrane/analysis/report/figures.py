"""The report's figures, each with the table it shows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from labcrane.analysis.report.style import COLOURS, HIGH, MARKERS, new_figure, styled
from labcrane.analysis.statistics.fitts import regress
from labcrane.analysis.statistics.learning import CURVES
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WORDS = {
    "movement_time": "movement time (s)",
    "circle_to_circle": "time from circle to circle (s)",
    "absolute_error": "distance from the target's centre (m)",
    "simultaneous": "time with two or more axes (fraction)",
    "bimanual": "time with both sticks (fraction)",
    "reversals": "stick reversals (1/s)",
    "sparc": "smoothness (SPARC)",
}


POSITION = "position in the sequence"
MEANS = "Points: means over participants' means, bars: 95 % confidence intervals (t),"
MOST_NAMED = 60
"""Participants that have their names in a figure; more of them would fill a page."""

LINE = 0.13
"""Inches from one name to the next."""

WORDS_A_LINE = 30
"""Letters of an axis' name beside a figure of one column: longer ones go into two lines."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure, its name for files, what it shows, and its table."""

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
def by_sequence(movements: "pd.DataFrame", measure: str) -> Drawing:
    """Draw a measure over the sequence: everybody thin, the mean of each group thick."""
    figure, (axes,) = new_figure()
    each = movements.groupby(["participant", "sequence"])[measure].mean().unstack(level=0)
    axes.plot(each.index, each, color="0.78", lw=0.5)
    groups = movements["group"].nunique() > 1 if "group" in movements else False
    by = ["group", "sequence"] if groups else ["sequence"]
    table = over(movements, measure, by)
    for number, (name, part) in enumerate(table.groupby("group") if groups else [("mean", table)]):
        for at, own in enumerate(_by_phase(movements, part)):
            label = str(name) if at == 0 else "_"
            _with_ci(axes, own["sequence"], own, number, label)
    if groups:
        _legend(figure, axes, "group")
    _set(axes, xlabel=POSITION, ylabel=WORDS.get(measure, measure))
    caption = (
        f"{_begun(WORDS.get(measure, measure))}, over the sequence. {MEANS} of "
        f"{_of(movements, 'group' if groups else '')}; thin lines: each participant."
    )
    return Drawing(f"{measure}_by_sequence", caption, figure, table)


def _by_phase(movements: "pd.DataFrame", table: "pd.DataFrame") -> "list[pd.DataFrame]":
    """Return a table cut where a session or block ends: no line leads from one into the next."""
    if "phase" not in movements:
        return [table]
    phases = movements.groupby("sequence")["phase"].first()
    return [part for _, part in table.groupby(table["sequence"].map(phases))]


@styled()
def by_distance(movements: "pd.DataFrame") -> Drawing:
    """Draw times and accuracy over the sequence for each distance."""
    shown = [
        name
        for name in ("circle_to_circle", "movement_time", "absolute_error")
        if name in movements and movements[name].notna().any()
    ]
    import pandas as pd

    figure, axes = new_figure(len(shown))
    tables = []
    for one, measure in zip(axes, shown, strict=True):
        table = over(movements, measure, ["distance", "sequence"])
        own = movements.groupby(["distance", "participant", "sequence"])[measure].mean()
        for number, (distance, part) in enumerate(table.groupby("distance")):
            each = own.loc[distance].unstack(level=0)
            aside = _aside(number, table["distance"].nunique())
            one.plot(
                each.index + aside, each, ".", color=COLOURS[number % len(COLOURS)], alpha=0.25,
                ms=2, mew=0,
            )  # fmt: skip
            _with_ci(one, part["sequence"] + aside, part, number, f"{distance:g} m")
        _set(one, xlabel=POSITION, ylabel=WORDS[measure])
        _keep_to(one, own)
        tables.append(table.assign(measure=measure))
    _legend(figure, axes[0], "distance")
    caption = (
        f"Times and accuracy over the sequence, for each distance. {MEANS} of {_of(movements)}, "
        "beside each other so that they can be told apart; dots: each participant. An interval of "
        "few participants may be wider than what is shown."
    )
    return Drawing("sequence_by_distance", caption, figure, pd.concat(tables))


@styled()
def fitts(movements: "pd.DataFrame") -> Drawing:
    """Draw movement time over difficulty, with the regression over participants' means."""
    import pandas as pd

    figure, (axes,) = new_figure()
    cells = movements.groupby(["participant", "difficulty"])["movement_time"].mean().reset_index()
    axes.plot(cells["difficulty"], cells["movement_time"], ".", color="0.6", ms=3)
    rows = []
    for participant, own in movements.groupby("participant"):
        rows.append(_line(str(participant), own["difficulty"], own["movement_time"]))
    whole = regress(_numbers(cells["difficulty"]), _numbers(cells["movement_time"]))
    rows.append(_line("all (participants' means)", cells["difficulty"], cells["movement_time"]))
    if whole is not None:
        x = np.array([cells["difficulty"].min(), cells["difficulty"].max()])
        axes.plot(x, whole.intercept + whole.slope * x, color=COLOURS[0])
    _set(axes, xlabel="index of difficulty (bit)", ylabel=WORDS["movement_time"])
    law = (
        f" Line: {whole.intercept:.2f} s + {whole.slope:.2f} s/bit, R² = {whole.r2:.2f}."
        if whole is not None
        else ""
    )
    caption = (
        f"Fitts' law: movement time over the index of difficulty. Dots: each participant's mean at "
        f"each difficulty, {_of(movements)}.{law}"
    )
    return Drawing("fitts", caption, figure, pd.DataFrame(rows))


def _numbers(column: "pd.Series[Any]") -> FloatArray:
    return np.asarray(column, np.float64)


def _line(who: str, x: "pd.Series[float]", y: "pd.Series[float]") -> dict[str, object]:
    fit = regress(_numbers(x), _numbers(y))
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

    Curves count from the first position of their session or block.
    """
    figure, (axes,) = new_figure()
    better = curves[(curves["measure"] == measure) & (curves["better"] == "yes")]
    people = {name: number for number, name in enumerate(better["participant"].unique())}
    for row in better.itertuples(index=False):
        own = movements[movements["participant"] == row.participant]
        if "phase" in better:
            own = own[own["phase"] == row.phase]
        means = own.groupby("sequence")[measure].mean()
        color = COLOURS[people[row.participant] % len(COLOURS)]
        axes.plot(means.index, means, ".", color=color, ms=3, alpha=0.6)
        before = float((own["sequence"] - own["place"]).iloc[0]) if "place" in own else 0.0
        n = np.linspace(1, float(means.index.max()) - before, 100)
        curve: Callable[..., np.ndarray] = CURVES[str(row.curve)]
        axes.plot(n + before, curve(n, row.asymptote, row.gain, row.rate), color=color, lw=0.8)
    _set(axes, xlabel=POSITION, ylabel=WORDS.get(measure, measure))
    caption = (
        f"Learning curves of {_begun(WORDS.get(measure, measure)).lower()}. Dots: each "
        f"participant's means; lines: the better of an exponential and a power curve, n = "
        f"{len(people)} {_people(len(people))}."
    )
    return Drawing(f"learning_{measure}", caption, figure, curves)


@styled()
def sticks(movements: "pd.DataFrame") -> Drawing:
    """Draw how the sticks were used over the sequence."""
    import pandas as pd

    measures = ("simultaneous", "bimanual", "reversals")
    figure, axes = new_figure(len(measures))
    tables = []
    for one, measure in zip(axes, measures, strict=True):
        table = over(movements, measure, ["sequence"])
        each = movements.groupby(["participant", "sequence"])[measure].mean().unstack(level=0)
        one.plot(each.index, each, color="0.78", lw=0.5)
        _with_ci(one, table["sequence"], table, 0, "mean")
        _set(one, xlabel=POSITION, ylabel=WORDS[measure])
        tables.append(table.assign(measure=measure))
    caption = (
        f"Use of the sticks over the sequence. {MEANS} of {_of(movements)}; thin lines: each "
        "participant."
    )
    return Drawing("sticks", caption, figure, pd.concat(tables))


@styled()
def throughputs(table: "pd.DataFrame") -> Drawing:
    """Draw each participant's throughput, the least at the bottom, each on a line of its own."""
    own = table.sort_values("throughput")
    named = len(own) <= MOST_NAMED
    figure, (axes,) = new_figure(high=max(HIGH, LINE * len(own) + 0.6) if named else HIGH)
    axes.plot(own["throughput"], np.arange(len(own)), "o", color=COLOURS[0])
    if named:
        axes.set_yticks(np.arange(len(own)), own["participant"])
    else:
        axes.set_yticks([])
    mean = float(table["throughput"].mean())
    axes.axvline(mean, color="k", lw=0.8)
    _set(axes, xlabel="throughput (bit/s)", ylabel="participant")
    caption = (
        f"Throughput: mean of means. Dots: each participant, n = {len(own)} {_people(len(own))}; "
        f"line: their mean, {mean:.3f} bit/s."
    )
    return Drawing("throughput", caption, figure, table)


def _set(axes: "Axes", xlabel: str, ylabel: str) -> None:
    from textwrap import fill

    axes.set(xlabel=xlabel, ylabel=fill(ylabel, WORDS_A_LINE))


def _legend(figure: "Figure", axes: "Axes", title: str) -> None:
    """Put a legend above the axes, where it covers nothing."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, title=title, loc="outside upper center", ncols=4)


def _keep_to(axes: "Axes", values: "pd.Series[float]") -> None:
    """Show the range of what was measured: an interval of two people would press it flat."""
    low, high = float(values.min()), float(values.max())
    aside = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_ylim(low - aside, high + aside)


def _begun(words: str) -> str:
    return words[:1].upper() + words[1:].partition(" (")[0]


def _people(count: int) -> str:
    return "participant" if count == 1 else "participants"


def _of(movements: "pd.DataFrame", by: str = "") -> str:
    """Return how many there are, and in which group."""
    count = int(movements["participant"].nunique())
    said = f"n = {count} {_people(count)}"
    if not by:
        return said
    sizes = movements.groupby(by)["participant"].nunique()
    return f"{said} ({', '.join(f'{size} {name}' for name, size in sizes.items())})"


def _aside(number: int, count: int) -> float:
    """Return how far a level stands beside its position, so that bars do not cover each other."""
    return 0.12 * (number - (count - 1) / 2.0)


def _with_ci(
    axes: "Axes", x: "pd.Series[Any]", table: "pd.DataFrame", number: int, label: str
) -> None:
    below, above = table["mean"] - table["ci_low"], table["ci_high"] - table["mean"]
    errors = np.nan_to_num(np.array([below, above], float))
    colour, marker = COLOURS[number % len(COLOURS)], MARKERS[number % len(MARKERS)]
    axes.errorbar(
        x.to_numpy(), table["mean"], errors, color=colour, marker=marker, capsize=1.5, label=label
    )


@styled()
def power_curve(table: "pd.DataFrame") -> "Figure":
    """Return the power over the size of the cohort, beside the rate of findings in nothing."""
    figure, (axes,) = new_figure()
    for name, words in (("power", "with the effect"), ("null", "labels permuted")):
        low, high = table[name] - table[f"{name}_low"], table[f"{name}_high"] - table[name]
        axes.errorbar(
            table["participants"], table[name], [low, high], marker="o", capsize=3, label=words
        )
    axes.axhline(0.8, color="0.6", linestyle="--", linewidth=1)
    axes.axhline(0.05, color="0.6", linestyle=":", linewidth=1)
    axes.set(xlabel="participants", ylabel="share of cohorts with p < 0.05", ylim=(-0.03, 1.03))
    axes.set_title("simulated operators", fontsize="medium")
    axes.set_xticks(table["participants"])
    axes.legend(loc="center right")
    return figure


def thresholds(table: "pd.DataFrame") -> "Figure":
    """Return estimates of thresholds over the true ones, a picture for each track."""
    names = list(dict.fromkeys(table["track"]))
    figure, pictures = new_figure(len(names))
    for name, axes in zip(names, pictures, strict=True):
        own = table[table["track"] == name].dropna(subset=["estimate"])
        axes.plot(own["truth"], own["estimate"], ".", markersize=3, alpha=0.4)
        ends = [own["truth"].min(), own["truth"].max()]
        axes.plot(ends, ends, color="0.3", linewidth=1)
        axes.set(xlabel="threshold", ylabel="estimate", title=f"{name}, simulated operators")
    return figure
