"""Output of commands; rich is loaded when the first of them prints."""

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
