"""HTML pages that need only their pictures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.analysis.report.figures import Drawing
from labcrane.analysis.report.style import save
from labcrane.files.html import rendered

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TEMPLATE = Path(__file__).with_name("report.html")
PIXELS_PER_INCH = 120
"""On the page: letters of 8 points in a figure are as large as those of its caption."""

MOST_ROWS = 200
MOST_WITHOUT_CONTENTS = 4
"""Sections of a page that is short enough to need no list of them."""


class Page:
    """A page that grows from top to bottom.

    Parameters
    ----------
    path
        Its path; pictures and tables go into ``figures`` and ``tables`` in the report's folder.
    root
        Folder of the report.
    prefix
        Put before the names of tables: the participant, on their page.
    footer
        Label below every figure and above every text, which may leave the page: ``SIMULATED``.
    """

    def __init__(
        self, title: str, path: Path, root: Path, prefix: str = "", footer: str = ""
    ) -> None:
        self._path, self._root, self._prefix = path, root, prefix
        self._footer = footer
        self._up = "../" * len(path.relative_to(root).parent.parts)
        self._title = title
        self._lead: Mapping[str, Sequence[str]] = {}
        self._body: list[tuple[str, Mapping[str, object]]] = []
        self._sections: list[str] = []

    def lead(self, parts: Mapping[str, Sequence[str]]) -> None:
        """Set the first paragraphs, by topic."""
        self._lead = parts

    def heading(self, text: str) -> None:
        """Begin a section, which the list of contents names."""
        self._sections.append(text)
        self._add("heading", text=text, number=len(self._sections))

    def say(self, text: str, *, stamp: bool = False) -> None:
        """Add a paragraph; a stamp is a highlighted one."""
        self._add("paragraph", text=text, stamp=stamp)

    def links(self, targets: Mapping[str, str]) -> None:
        """Add links by their texts."""
        self._add("links", targets=targets)

    def table(self, name: str, table: "pd.DataFrame") -> None:
        """Add a folded table, and write it as CSV; a long one is cut here and whole in the file."""
        rounded = table.head(MOST_ROWS).map(_shown)
        self._add(
            "table",
            name=name.replace("_", " "),
            csv=self._csv(name, table),
            count=len(table),
            shown=MOST_ROWS,
            rows=rounded.to_html(index=False, border=0, na_rep="", escape=True, justify="inherit"),
        )

    def rows(self, name: str, table: "pd.DataFrame", said: str = "", heading: str = "") -> None:
        """Add a table with its heading and sentence; nothing if it has no rows."""
        if len(table):
            if heading:
                self.heading(heading)
            if said:
                self.say(said)
            self.table(name, table)

    def text(self, name: str, text: str) -> None:
        """Write a text into the page's folder, the footer in its first line, and link to it."""
        said = f"{self._footer}.\n\n" if self._footer else ""
        (self._root / name).write_text(said + text, encoding="utf-8")
        self.links({name: f"{self._up}{name}"})

    def draw(self, drawing: Drawing) -> None:
        """Add a figure as SVG, PNG and PDF, and its table as CSV."""
        figure, folder = drawing.figure, self._root / "figures"
        folder.mkdir(exist_ok=True)
        save(figure, folder / drawing.name, self._footer)
        self._add(
            "figure",
            caption=drawing.caption,
            picture=f"{self._up}figures/{drawing.name}",
            csv=self._csv(drawing.name, drawing.table),
            size=_size(figure),
            whole=len(figure.axes) > 1,
        )

    def _add(self, kind: str, **it: object) -> None:
        self._body.append((kind, it))

    def write(self) -> Path:
        """Write the page: first figure, answer and list of contents before everything else."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        short = len(self._sections) < MOST_WITHOUT_CONTENTS
        early = [one for one in self._body if one[0] == "figure"][:1] if self._lead else []
        text = rendered(
            TEMPLATE,
            title=self._title,
            lead=self._lead,
            contents=[] if short else self._sections,
            first=early[0][1] if early else None,
            body=[one for one in self._body if one not in early],
            up=self._up,
        )
        self._path.write_text(text, encoding="utf-8")
        return self._path

    def _csv(self, name: str, table: "pd.DataFrame") -> str:
        folder = self._root / "tables"
        folder.mkdir(exist_ok=True)
        path = folder / f"{self._prefix}{name}.csv"
        table.to_csv(path, index=False)
        return f"tables/{path.name}"


def _size(figure: "Figure") -> tuple[int, int]:
    """Return a picture's size on the page: known before it has come, nothing jumps."""
    wide, high = (round(PIXELS_PER_INCH * inches) for inches in figure.get_size_inches())
    return wide, high


def _shown(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else value
