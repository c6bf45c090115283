"""The paper's tables 3 and 4 as they are printed, in Markdown and LaTeX.

Their numbers and headings are not in the text that is left of the paper; what they hold is said
around them (Typiak 2024, section 3). Speeds and errors are in deg/s.
"""

from collections.abc import Sequence
from pathlib import Path

from labcrane_dmd.fit.validation import Level, summary
from labcrane_dmd.model.output import written

AVERAGES = {
    "mse": "MSE",
    "rmse": "RMSE",
    "mae": "MAE",
    "residual_variance": "Residual variance",
}
"""Of the third table, by the columns of the summary."""

Lines = list[list[str]]


def table_3(levels: Sequence[Level]) -> Lines:
    """Return each segment's averages over its levels, with the heading first."""
    return [
        ["Segment", *AVERAGES.values()],
        *(
            [str(row["segment"]), *(f"{float(row[name]):.4f}" for name in AVERAGES)]
            for row in summary(levels)
        ),
    ]


def table_4(levels: Sequence[Level]) -> Lines:
    """Return the average speeds at each level, how far they are apart, and in percent.

    The percentage is that of the paper: 0.0959 of 5.048 deg/s are 1.9 %.
    """
    lines = [["Segment", "Control signal", "Real", "Simulator", "Error", "Error, %"]]
    for level in levels:
        row = level.row()
        error, real = abs(float(row["mean_error"])), float(row["mean_speed"])
        lines.append(
            [
                level.segment,
                f"{level.signal:d}",
                f"{real:.3f}",
                f"{float(row['model_mean_speed']):.3f}",
                f"{error:.4f}",
                f"{100.0 * error / abs(real):.1f}" if real else "-",
            ]
        )
    return lines


def write_printed(levels: Sequence[Level], folder: Path, ending: str) -> None:
    """Write both tables, each as Markdown and as LaTeX.

    Raises
    ------
    RecordingError
        They cannot be written.
    """
    for name, lines in (("table_3", table_3(levels)), ("table_4", table_4(levels))):
        for suffix, text in ((".md", _markdown(lines)), (".tex", _latex(lines))):
            path = folder / f"{name}{ending}{suffix}"
            with written(path):
                path.write_text(text, encoding="utf-8")


def _markdown(lines: Lines) -> str:
    head, *rows = (f"| {' | '.join(line)} |" for line in lines)
    rule = "|---|" + "---:|" * (len(lines[0]) - 1)
    return "\n".join([head, rule, *rows, ""])


def _latex(lines: Lines) -> str:
    columns = "l" + "r" * (len(lines[0]) - 1)
    head, *rows = (
        " & ".join(cell.replace("%", r"\%").replace("_", r"\_") for cell in line) + r" \\"
        for line in lines
    )
    parts = [rf"\begin{{tabular}}{{{columns}}}", r"\hline", head, r"\hline", *rows, r"\hline"]
    return "\n".join([*parts, r"\end{tabular}", ""])
