"""Output of commands; rich is loaded when the first of them prints."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.style import StyleType
    from rich.table import Table


class Output:
    """Standard output without automatic line breaks or colours."""

    @cached_property
    def console(self) -> "Console":
        """The console, for output other than lines."""
        from rich.console import Console

        return Console(soft_wrap=True, highlight=False)

    def print(
        self,
        *parts: "RenderableType",
        markup: bool | None = None,
        style: "StyleType | None" = None,
        highlight: bool | None = None,
    ) -> None:
        """Print a line or a table."""
        self.console.print(*parts, markup=markup, style=style, highlight=highlight)


out = Output()


def whole_table(*titles: str) -> "Table":
    """Return a table that wraps long cells and does not cut them."""
    from rich.table import Table

    table = Table()
    for title in titles:
        table.add_column(title, overflow="fold")
    return table


def print_rows(
    titles: Sequence[str], rows: Sequence[Sequence[str]], styles: Sequence[str] | None = None
) -> None:
    """Print rows as a table, or one after another in words where a table would not fit.

    Parameters
    ----------
    titles
        Of the columns; the first says whose a row is.
    styles
        The colour of each row; none by default.
    """
    from textwrap import fill

    from rich.cells import cell_len
    from rich.text import Text

    columns = zip(titles, *rows, strict=True)
    needed = sum(max(map(cell_len, column)) + 3 for column in columns) + 1
    colours = styles or [""] * len(rows)
    if needed <= out.console.width:
        table = whole_table(*titles)
        for row, colour in zip(rows, colours, strict=True):
            table.add_row(*map(Text, row), style=colour)
        out.print(table)
        return
    for row, colour in zip(rows, colours, strict=True):
        told = ", ".join(f"{title} {cell}" for title, cell in zip(titles[1:], row[1:], strict=True))
        text = f"{row[0]}: {told}"
        if out.console.is_terminal:
            text = fill(text, out.console.width, subsequent_indent="  ", break_on_hyphens=False)
        out.print(text, markup=False, style=colour or None)
