"""The table of all figures: a row for each, and a column for each computer."""

import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from benchmarks.table import Row

HEAD = ("benchmark", "figure", "reference", "at most")


def machine() -> str:
    """Return a short description of the computer."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        names = [line for line in lines if line.startswith("model name")]
        model = names[0].partition(":")[2].strip() if names else model
    return f"{os.cpu_count()} cores {model}, Python {platform.python_version()}"


@dataclass
class Figure:
    """One figure: the maximum of its ratio, and what each computer measured.

    A computer's cell is the ratio, what it is of, and the day: ``0.92 (44.7 / 48.5, 2026-11-28)``.
    """

    limit: float
    cells: dict[str, str] = field(default_factory=dict)


@dataclass
class Results:
    """All figures of all computers, by benchmark, name and reference."""

    figures: dict[tuple[str, str, str], Figure] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path) -> "Results":
        """Return the figures of a table that :meth:`text` made."""
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        table = [
            [cell.strip() for cell in line.strip("|").split("|")]
            for line in lines
            if line.startswith("| ")
        ]
        found = cls()
        for subject, what, reference, limit, *cells in table[1:]:
            there = zip(table[0][len(HEAD) :], cells, strict=True)
            found.figures[subject, what, reference] = Figure(
                float(limit), {computer: cell for computer, cell in there if cell}
            )
        return found

    def put(self, subject: str, rows: Iterable[Row]) -> None:
        """Put in what this computer measured; figures that are not measured any more go."""
        now = {}
        for row in rows:
            key = subject, row.what, row.reference
            measured = f"{row.ours:.3g} / {row.bare:.3g}, {datetime.now(UTC).date()}"
            cell = f"{_short(row.ratio)} ({measured})"
            others = self.figures[key].cells if key in self.figures else {}
            now[key] = Figure(row.limit, {**others, machine(): cell})
        kept = {key: each for key, each in self.figures.items() if key[0] != subject}
        self.figures = {**kept, **now}

    def missed_elsewhere(self, subjects: Iterable[str]) -> list[str]:
        """Return which ratios of other computers are above their limits."""
        chosen = set(subjects)
        return [
            f"{subject}: {what}: {cell} of {figure.limit:.2f} on {computer}; measure it again there"
            for (subject, what, _), figure in self.figures.items()
            for computer, cell in figure.cells.items()
            if subject in chosen
            and computer != machine()
            and not float(cell.split()[0]) <= figure.limit
        ]

    def text(self, subjects: Sequence[str]) -> str:
        """Return the table, the benchmarks in the order of ``subjects``."""
        computers = dict.fromkeys(each for row in self.figures.values() for each in row.cells)
        head = [*HEAD, *computers]
        rows = [
            [*key, _short(self.figures[key].limit)]
            + [self.figures[key].cells.get(computer, "") for computer in computers]
            for subject in subjects
            for key in self.figures
            if key[0] == subject
        ]
        lines = "".join(f"| {' | '.join(row)} |\n" for row in [head, ["---"] * len(head), *rows])
        return f"{about()}{lines.replace('| --- ', '|---').replace('|--- |', '|---|')}"


def _short(ratio: float) -> str:
    return f"{ratio:.2f}" if ratio >= 0.01 else f"{ratio:.1g}"


def about() -> str:
    """Return the text above the table."""
    return (
        "# Benchmarks\n\n"
        f"Made by `python -m benchmarks` with labcrane {version('labcrane')}, once on each "
        "computer. A cell is a ratio, and\nin brackets labcrane's figure, that of a bare reference "
        "from the same minutes, and the day. `--check`\nfails where a ratio exceeds its limit (*at "
        "most*) on any computer.\n\n"
    )
