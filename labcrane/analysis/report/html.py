"""HTML pages that need nothing but themselves and their pictures."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from labcrane.analysis.report.figures import Drawing
from labcrane.analysis.report.panels import svg_of
from labcrane.analysis.report.style import save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

STYLE = """
:root { color-scheme: light dark; --back: #fff; --ink: #111827; --faint: #4b5563; --rule: #cbd5e1;
  --link: #0b4a8f; --lead: #eef4fb; --stamp: #fde8ee; --edge: #a3174f }
@media (prefers-color-scheme: dark) { :root { --back: #0d1117; --ink: #e6eaf0; --faint: #a7b0bd;
  --rule: #364152; --link: #7cc0f5; --lead: #16202c; --stamp: #3a1522; --edge: #ff8fb3 } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem;
  background: var(--back); color: var(--ink); overflow-wrap: anywhere }
a { color: var(--link) }
h2 { margin-top: 2.5rem; border-top: 1px solid var(--rule); padding-top: 1rem }
.wide { overflow-x: auto } table { border-collapse: collapse; font-size: 13px }
th, td { border-bottom: 1px solid var(--rule); padding: .2rem .6rem; text-align: right;
  min-width: 4rem }
th:first-child, td:first-child { text-align: left }
summary { cursor: pointer; padding: .4rem 0 } details { margin: .5rem 0 }
figure { margin: 1.5rem 0; break-inside: avoid }
figure img { max-width: 100%; background: #fff; border-radius: .3rem }
figcaption { color: var(--faint); max-width: 42rem; font-size: 14px }
.lead { background: var(--lead); border-radius: .6rem; padding: .5rem 1.5rem 1rem;
  break-after: page }
.lead h2 { border: 0; margin-top: .6rem; padding: 0; font-size: 1.15rem }
nav ol { columns: 2; margin: .3rem 0 } nav li { padding: .2rem 0 }
nav a, p > a, figcaption a { min-height: 24px; display: inline-block; min-width: 24px }
.stamp { background: var(--stamp); border-left: 4px solid var(--edge); padding: .5rem 1rem }
@media print { :root { --back: #fff; --ink: #000; --faint: #333; --rule: #999; --lead: #fff;
  --link: #000 } body { max-width: none; margin: 0; font-size: 10pt } nav { display: none }
  .wide { overflow: visible } table { font-size: 7pt } }
"""
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
        self._lead: list[str] = []
        self._sections: list[str] = []

    def lead(self, parts: Mapping[str, Sequence[str]]) -> None:
        """Set what stands first: paragraphs by what they are about."""
        self._lead = [
            f"<h2>{html.escape(about)}</h2>"
            + "".join(f"<p>{html.escape(text)}</p>" for text in texts)
            for about, texts in parts.items()
            if texts
        ]

    def heading(self, text: str) -> None:
        """Begin a section, which the list of contents names."""
        self._sections.append(text)
        ident = len(self._sections)
        self._body.append(f'<h2 id="section-{ident}">{html.escape(text)}</h2>')

    def say(self, text: str, *, stamp: bool = False) -> None:
        """Add a paragraph; a stamp is one that nobody may miss."""
        kind = ' class="stamp"' if stamp else ""
        self._body.append(f"<p{kind}>{html.escape(text)}</p>")

    def links(self, targets: dict[str, str]) -> None:
        """Add links by their texts."""
        items = [f'<a href="{html.escape(to)}">{html.escape(t)}</a>' for t, to in targets.items()]
        self._body.append(f"<p>{' · '.join(items)}</p>")

    def table(self, name: str, table: "pd.DataFrame") -> None:
        """Add a folded table, and write it as CSV; a long one is cut here and whole in the file."""
        where = self._csv(name, table)
        rounded = table.head(MOST_ROWS).map(_shown)
        rows = rounded.to_html(index=False, border=0, na_rep="", escape=True, justify="inherit")
        cut = f", first {MOST_ROWS} of {len(table)} rows here" if len(table) > MOST_ROWS else ""
        called = name.replace("_", " ")
        self._body.append(
            f"<details><summary>Table: {html.escape(called)}, {len(table)} rows{cut}</summary>"
            f'<div class="wide" tabindex="0" role="group" aria-label="{html.escape(called)}">'
            f'{rows}</div></details><p><a href="{self._up}{where}">{where}</a></p>'
        )

    def text(self, name: str, text: str) -> None:
        """Write a text beside the page, and link to it."""
        (self._root / name).write_text(text, encoding="utf-8")
        self.links({name: f"{self._up}{name}"})

    def draw(self, drawing: Drawing) -> None:
        """Add a figure by Matplotlib, as SVG, PNG and PDF, and its table as CSV."""
        figure = drawing.figure
        save(figure, self._figure(drawing))
        self._show(drawing, _size(figure), "svg", "png", "pdf")

    def sketch(self, drawing: Drawing) -> None:
        """Add a figure as plain SVG, and write its table as CSV; a hundred times as fast."""
        self._figure(drawing).with_suffix(".svg").write_text(
            svg_of(drawing.panels), encoding="utf-8"
        )
        self._show(drawing, "", "svg")

    def _figure(self, drawing: Drawing) -> Path:
        folder = self._root / "figures"
        folder.mkdir(exist_ok=True)
        return folder / f"{self._prefix}{drawing.name}"

    def _show(self, drawing: Drawing, size: str, *forms: str) -> None:
        where = self._csv(drawing.name, drawing.table)
        picture = f"{self._up}figures/{self._prefix}{drawing.name}"
        links = [f'<a href="{picture}.{form}">{form.upper()}</a>' for form in forms]
        links.append(f'<a href="{self._up}{where}">CSV</a>')
        self._body.append(
            f'<figure><img loading="lazy" {size} src="{picture}.svg" '
            f'alt="{html.escape(drawing.caption)}">'
            f"<figcaption>{html.escape(drawing.caption)} ({', '.join(links)})</figcaption></figure>"
        )

    def write(self) -> Path:
        """Write the page."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        first, *rest = self._body
        body = "\n".join([first, *self._led(), *rest])
        self._path.write_text(
            f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" '
            f'content="width=device-width, initial-scale=1"><title>{html.escape(self._title)}'
            f"</title><style>{STYLE}</style>\n<main>{body}</main>\n</html>\n",
            encoding="utf-8",
        )
        return self._path

    def _led(self) -> list[str]:
        """Return the answer and the list of contents, which stand before everything else."""
        lead = ['<section class="lead">', *self._lead, "</section>"] if self._lead else []
        if len(self._sections) < MOST_WITHOUT_CONTENTS:
            return lead
        items = "".join(
            f'<li><a href="#section-{number}">{html.escape(text)}</a></li>'
            for number, text in enumerate(self._sections, 1)
        )
        return [*lead, f'<nav aria-label="Contents"><h2>Contents</h2><ol>{items}</ol></nav>']

    def _csv(self, name: str, table: "pd.DataFrame") -> str:
        folder = self._root / "tables"
        folder.mkdir(exist_ok=True)
        path = folder / f"{self._prefix}{name}.csv"
        table.to_csv(path, index=False)
        return f"tables/{path.name}"


def _size(figure: "Figure") -> str:
    """Return a picture's size on the page: known before it has come, nothing jumps."""
    wide, high = (round(PIXELS_PER_INCH * inches) for inches in figure.get_size_inches())
    return f'width="{wide}" height="{high}" style="height:auto"'


def _shown(value: object) -> object:
    return f"{value:.4g}" if isinstance(value, float) else value
