"""Element of a NiceGUI page that draws the control room; importing it loads NiceGUI."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from nicegui import events
from nicegui.element import Element
from nicegui.elements import echart  # noqa: F401 - brings ECharts, which a chart imports

REMEMBERED = 200
"""Orders whose names are kept: one that was sent again, as its answer was lost, is given once."""

STYLE = Path(__file__).with_name("room.css")

Give = Callable[[str, str], str]


class Room(Element, component="room.js", esm={"labcrane-chart": "../chart"}):
    """Draws its snapshot, and passes on the experimenter's actions.

    Parameters
    ----------
    first
        Everything that is shown at first, by name.
    keys
        What each key does.
    give
        Gives an order with its words; returns why it was not given, or nothing.
    close
        Called when the page is closed at the end.
    """

    def __init__(
        self,
        first: Mapping[str, Any],
        keys: Sequence[Mapping[str, str]],
        give: Give,
        close: Callable[[], None],
    ) -> None:
        super().__init__()
        self._props["first"] = dict(first)
        self._props["keys"] = list(keys)
        self._shown = {name: _written(part) for name, part in first.items()}
        self._give = give
        self._answered: dict[str, str] = {}
        self.on("order", self._order)
        self.on("close", lambda _: close())

    def show(self, parts: Mapping[str, Any]) -> None:
        """Show what has changed of it."""
        changed = {}
        for name, part in parts.items():
            if (written := _written(part)) != self._shown.get(name):
                self._shown[name], changed[name] = written, part
        if changed:
            self._props["first"].update(changed)  # of a browser that loads the page again
            self.run_method("show", changed)

    def _order(self, event: events.GenericEventArguments) -> None:
        ident, order, text = (str(event.args.get(key, "")) for key in ("ident", "order", "text"))
        if ident not in self._answered:
            if len(self._answered) >= REMEMBERED:
                self._answered.pop(next(iter(self._answered)))
            self._answered[ident] = self._give(order, text)
        self.run_method("taken", ident, self._answered[ident])


def _written(part: Any) -> str:
    return json.dumps(part, sort_keys=True)
