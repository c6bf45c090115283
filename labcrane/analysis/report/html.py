"""HTML pages that need nothing but themselves and their pictures."""

import html
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.analysis.report.figures import Drawing
from labcrane.analysis.report.panels import svg_of

if TYPE_CHECKING:
    import pandas as pd

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem }
table { border-collapse: collapse; font-size: 13px; display: block; overflow-x: auto }
th, td { border-bottom: 1px solid #ccc; padding: .2rem .6rem; text-align: right }
th:first-child, td:first-child { text-align: left }
img { max-width: 100% } figure { margin: 1.5rem 0 } figcaption { color: #444 }
.stamp { background: #fde; border-left: 4px solid #c36; padding: .5rem 1rem }
"""
DOTS_PER_INCH = 120
MOST_ROWS = 200


class Page:
    """A page that grows from top to bottom.

    Parameters
    ----------
    path
        Where it will be; pictures and tables go into ``figures`` and ``tables`` beside the report.
    root
        Folder of the report.
    prefix
        Put before the names of pictures and tables: the participant, on their page.
    """

    def __init__(self, title: str, path: Path, root: Path, prefix: str = "") -> None:
        self._path, self._root, self._prefix = path, root, prefix
        self._up = "../" * len(path.relative_to(root).parent.parts)
        self._body = [f"<h1>{html.escape(title)}</h1>"]
        self._title = title

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._body.append(f"<h2>{html.escape(text)}</h2>")

    def say(self, text: str, *, stamp: bool = False) -> None:
        """Add a paragraph; a stamp is one that nobody may miss."""
        kind = ' class="stamp"' if stamp else ""
        self._body.append(f"<p{kind}>{html.escape(text)}</p>")

    def links(self, targets: dict[str, str]) -> None:
        """Add links by their texts."""
        items = [f'<a href="{html.escape(to)}">{html.escape(t)}</a>' for t, to in targets.items()]
        self._body.append(f"<p>{' · '.join(items)}</p>")

    def table(self, name: str, table: "pd.DataFrame") -> None:
        """Add a table, and write it as CSV; a long one is cut on the page and whole in the file."""
        where = self._csv(name, table)
        rounded = table.head(MOST_ROWS).map(_shown)
        self._body.append(rounded.to_html(index=False, border=0, na_rep="", escape=True))
        cut = f", first {MOST_ROWS} of {len(table)} rows here" if len(table) > MOST_ROWS else ""
        self._body.append(f'<p><a href="{self._up}{where}">{where}</a>{cut}</p>')

    def text(self, name: str, text: str) -> None:
        """Write a text beside the page, and link to it."""
        (self._root / name).write_text(text, encoding="utf-8")
        self.links({name: f"{self._up}{name}"})

    def draw(self, drawing: Drawing) -> None:
        """Add a figure by Matplotlib, and write it as SVG and PNG, and its table as CSV."""
        path = self._figure(drawing)
        figure = drawing.figure
        figure.savefig(path.with_suffix(".svg"))
        figure.savefig(path.with_suffix(".png"), dpi=DOTS_PER_INCH)
        self._show(drawing, "svg", "png")

    def sketch(self, drawing: Drawing) -> None:
        """Add a figure as plain SVG, and write its table as CSV; a hundred times as fast."""
        self._figure(drawing).with_suffix(".svg").write_text(
            svg_of(drawing.panels), encoding="utf-8"
        )
        self._show(drawing, "svg")

    def _figure(self, drawing: Drawing) -> Path:
        folder = self._root / "figures"
        folder.mkdir(exist_ok=True)
        return folder / f"{self._prefix}{drawing.name}"

    def _show(self, drawing: Drawing, *forms: str) -> None:
        where = self._csv(drawing.name, drawing.table)
        picture = f"{self._up}figures/{self._prefix}{drawing.name}"
        links = [f'<a href="{picture}.{form}">{form.upper()}</a>' for form in forms]
        links.append(f'<a href="{self._up}{where}">CSV</a>')
        self._body.append(
            f'<figure><img src="{picture}.svg" alt="{html.escape(drawing.caption)}">'
            f"<figcaption>{html.escape(drawing.caption)} ({', '.join(links)})</figcaption></figure>"
        )

    def write(self) -> Path:
        """Write the page."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        body = "\n".join(self._body)
        self._path.write_text(
            f'<!doctype html><html lang="en"><meta charset="utf-8">'
            f"<title>{html.escape(self._title)}</title><style>{STYLE}</style>\n{body}\n</html>\n",
            encoding="utf-8",
        )
        return self._path

    def _csv(self, name: str, table: "pd.DataFrame") -> str:
        folder = self._root / "tables"
        folder.mkdir(exist_ok=True)
        path = folder / f"{self._prefix}{name}.csv"
        table.to_csv(path, index=False)
        return f"tables/{path.name}"


def _shown(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else value
