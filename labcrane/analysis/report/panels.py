"""Panels of a figure: axes with lines and dots as numbers, drawn by Matplotlib."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Literal

from labcrane.analysis.report.style import COLOURS, MARKERS, new_figure, styled
from labcrane.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GREY, FAINT = "#999999", "#c7c7c7"
"""Of dots, and of thin lines behind everything else."""


@dataclass(frozen=True)
class Series:
    """Numbers that belong together.

    Attributes
    ----------
    x, y
        Shape ``(n,)``; what is NaN is left out.
    colour
        An HTML colour.
    kind
        Whether they are joined by a line, dots, or both.
    label
        In the legend; empty for none.
    reach
        Uncertainty of each downwards and upwards, shape ``(2, n)``; None for no bars.
    """

    x: FloatArray
    y: FloatArray
    colour: str = COLOURS[0]
    kind: Literal["line", "dots", "both"] = "both"
    label: str = ""
    reach: FloatArray | None = None


@dataclass(frozen=True)
class Panel:
    """Axes with their series.

    Attributes
    ----------
    across, up
        Names of the axes, with their units.
    legend
        Heading of the series' labels.
    keep
        Range of the vertical axis; None for all values.
    """

    across: str
    up: str
    series: Sequence[Series]
    title: str = ""
    legend: str = ""
    keep: tuple[float, float] | None = None


WORDS_A_LINE = 30
"""Letters of an axis' name beside a figure of one column: longer ones go into two lines."""


def lighter(colour: str) -> str:
    """Return a colour as it looks at a third of its strength on white."""
    parts = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    return "#" + "".join(f"{255 - (255 - part) // 3:02x}" for part in parts)


@styled()
def figure_of(panels: Sequence[Panel]) -> "Figure":
    """Return panels as a figure of Matplotlib."""
    figure = new_figure(len(panels))
    for axes, panel in zip(figure.axes, panels, strict=True):
        for one in panel.series:
            known = COLOURS.index(one.colour) if one.colour in COLOURS else 0
            dots = {"line": "", "dots": ".", "both": MARKERS[known]}[one.kind]
            line = "" if one.kind == "dots" else "-"
            style = {"color": one.colour, "marker": dots, "linestyle": line}
            label = one.label or None
            if one.reach is None:
                width = 0.5 if one.colour == FAINT else 0.8
                axes.plot(one.x, one.y, lw=width, label=label, **style)  # type: ignore[arg-type]  # of several kinds
            else:
                axes.errorbar(one.x, one.y, one.reach, capsize=1.5, label=label, **style)  # type: ignore[arg-type]
        axes.set(xlabel=panel.across, ylabel=fill(panel.up, WORDS_A_LINE), title=panel.title)
        if panel.keep is not None:
            axes.set_ylim(*panel.keep)
    named = [
        each for axes in figure.axes for each in zip(*axes.get_legend_handles_labels(), strict=True)
    ]
    if named:
        handles, labels = zip(*named, strict=True)
        title = panels[0].legend or None
        figure.legend(handles, labels, title=title, loc="outside upper center", ncols=4)
    return figure
