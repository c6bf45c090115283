"""Panels of a figure: axes with lines and dots as numbers, with two renderers.

Matplotlib draws what a study publishes. It takes a second of the processor for the figures of one
participant, which is most of what a report of a large study would take; their pages are drawn as
plain SVG, of the same numbers.
"""

import html
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Literal

import numpy as np

from labcrane.analysis.report.style import COLOURS, MARKERS, new_figure, styled
from labcrane.types import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GREY, FAINT = "#999999", "#c7c7c7"
"""Of dots, and of thin lines behind everything else."""

WIDTH, HEIGHT = 5.2, 3.8
"""Of a panel in SVG, in inches."""

DOTS_PER_INCH = 72
LEFT, RIGHT, TOP, BOTTOM = 58.0, 12.0, 24.0, 44.0
"""What is left free around a panel's axes in SVG, in points."""

FOOTER = 16.0
"""Of the line below all panels, in points."""

MOST_TICKS = 6
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


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


def svg_of(panels: Sequence[Panel], footer: str = "") -> str:
    """Return panels as the text of an SVG file; ``footer`` is below them."""
    width, height = WIDTH * DOTS_PER_INCH, HEIGHT * DOTS_PER_INCH
    parts = [
        f'<g transform="translate({number * width:g} 0)">{"".join(_axes(panel, width, height))}</g>'
        for number, panel in enumerate(panels)
    ]
    if footer:
        parts.append(
            f'<text x="{len(panels) * width / 2:g}" y="{height + FOOTER - 4:g}" fill="black" '
            f'font-weight="bold" text-anchor="middle">{html.escape(footer)}</text>'
        )
        height += FOOTER
    size = f"{len(panels) * width:g}", f"{height:g}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]}pt" height="{size[1]}pt" '
        f'viewBox="0 0 {size[0]} {size[1]}" font-family="sans-serif" font-size="10" '
        f'fill="none"><rect width="100%" height="100%" fill="white"/>\n'
        + "\n".join(parts)
        + "\n</svg>\n"
    )


def ticks(low: float, high: float) -> list[float]:
    """Return round numbers between two, at most six of them.

    Steps are 1, 2, 2.5 or 5 times a power of ten.
    """
    if not high > low:
        return [low]
    rough = (high - low) / (MOST_TICKS - 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(each * power for each in STEPS if each * power >= rough * (1.0 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


@dataclass(frozen=True)
class _Scale:
    """Turns a number into points of an axis that runs from ``start`` to ``end``."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        share = (value - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)


def _scale(values: FloatArray, start: float, end: float) -> _Scale:
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    free = 0.05 * (high - low) or 0.05 * abs(high) or 0.5
    return _Scale(low - free, high + free, start, end)


def _reached(one: Series) -> FloatArray:
    """Return how far down and up a series and its bars go, shape ``(2, n)``."""
    reach = np.zeros((2, len(one.y))) if one.reach is None else np.nan_to_num(one.reach)
    return np.array([one.y - reach[0], one.y + reach[1]])


def _axes(panel: Panel, width: float, height: float) -> Iterator[str]:
    xs = np.concatenate([np.asarray(one.x, float) for one in panel.series] or [np.empty(0)])
    ys = np.concatenate([_reached(one).ravel() for one in panel.series] or [np.empty(0)])
    floor, middle = height - BOTTOM, LEFT + (width - LEFT - RIGHT) / 2.0
    across = _scale(xs, LEFT, width - RIGHT)
    up = _Scale(*panel.keep, floor, TOP) if panel.keep else _scale(ys, floor, TOP)
    for value in ticks(across.low, across.high):
        x = f"{across(value):.1f}"
        yield f'<path d="M{x} {floor:g}V{TOP:g}" stroke="#ddd"/>'
        yield _text(across(value), floor + 14.0, f"{value:.6g}")
    for value in ticks(up.low, up.high):
        y = f"{up(value):.1f}"
        yield f'<path d="M{LEFT:g} {y}H{width - RIGHT:g}" stroke="#ddd"/>'
        yield _text(LEFT - 5.0, up(value) + 3.5, f"{value:.6g}", "end")
    yield f'<path d="M{LEFT:g} {TOP:g}V{floor:g}H{width - RIGHT:g}" stroke="black"/>'
    yield _text(middle, height - 10.0, panel.across)
    turned = f' transform="rotate(-90 12 {(TOP + floor) / 2.0:g})"'
    yield _text(12.0, (TOP + floor) / 2.0, panel.up, also=turned)
    yield _text(middle, 15.0, panel.title) if panel.title else ""
    box = f"{LEFT:g} {TOP:g} {width - LEFT - RIGHT:g} {floor - TOP:g}"
    x, y, wide, high = box.split()
    yield f'<svg x="{x}" y="{y}" width="{wide}" height="{high}" viewBox="{box}">'  # cuts at keep
    for one in panel.series:
        yield from _drawn(one, across, up)
    yield "</svg>"
    yield from _legend(panel, width)


def _drawn(one: Series, across: _Scale, up: _Scale) -> Iterator[str]:
    points = [
        (across(x), up(y), up(low), up(high))
        for x, y, low, high in zip(one.x, one.y, *_reached(one), strict=True)
        if math.isfinite(x) and math.isfinite(y)
    ]
    if one.kind != "dots":
        way = " ".join(f"{x:.1f},{y:.1f}" for x, y, *_ in points)
        yield f'<polyline points="{way}" stroke="{one.colour}" stroke-width="1.2"/>'
    for x, y, low, high in points:
        if one.kind != "line":
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2" fill="{one.colour}"/>'
        if low != high:
            yield f'<path d="M{x:.1f} {low:.1f}V{high:.1f}" stroke="{one.colour}"/>'


def _legend(panel: Panel, width: float) -> Iterator[str]:
    said = [(one.label, one.colour) for one in panel.series if one.label]
    rows = [(panel.legend, "black"), *said] if said and panel.legend else said
    for number, (label, colour) in enumerate(rows):
        yield _text(width - RIGHT, TOP + 10.0 + 12.0 * number, label, "end", colour)


def _text(
    x: float, y: float, text: str, anchor: str = "middle", colour: str = "black", also: str = ""
) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"{also}'
    return f"<text {place}>{html.escape(text)}</text>"
