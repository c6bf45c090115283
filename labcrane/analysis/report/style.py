"""Style of every figure: sizes of journals, readable letters, colours for all viewers."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MM = 1.0 / 25.4
COLUMN, PAGE = 85.0 * MM, 174.0 * MM
"""Widths of one and of two columns of a journal's page, in inches."""

HIGH = 65.0 * MM

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Colours of Okabe and Ito, which all viewers can distinguish; their yellow is too faint."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""In addition to colours, for printing without them."""

DOTS_PER_INCH = 300

_STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.title_fontsize": 7.0,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "svg.hashsalt": "labcrane",
}


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style inside of the block."""
    import matplotlib as mpl
    from cycler import cycler

    with mpl.rc_context({**_STYLE, "axes.prop_cycle": cycler(color=COLOURS)}):
        yield


def new_figure(columns: int = 1, high: float = HIGH) -> "Figure":
    """Return an empty figure with some axes beside each other; needs no display.

    One has the width of a column of a journal, more that of its page. ``high`` is in inches.
    """
    from matplotlib.figure import Figure

    with styled():
        figure = Figure(figsize=(COLUMN if columns == 1 else PAGE, high), layout="constrained")
        axes = [figure.add_subplot(1, columns, at + 1) for at in range(columns)]
        for one in axes:
            one.grid(alpha=0.3, linewidth=0.4)
            one.spines[["top", "right"]].set_visible(False)
    return figure


def save(figure: "Figure", path: Path, footer: str = "") -> None:
    """Write a figure as SVG, PNG and PDF, by a path without an ending; ``footer`` is below it."""
    with styled():
        if footer:
            figure.supxlabel(footer, fontsize=7.0, fontweight="bold")
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # found once, not for every format
        figure.savefig(path.with_name(f"{path.name}.svg"), metadata={"Date": None})
        figure.savefig(path.with_name(f"{path.name}.png"), dpi=DOTS_PER_INCH)
        figure.savefig(path.with_name(f"{path.name}.pdf"), metadata={"CreationDate": None})
