"""Element of a NiceGUI page that draws a recording's time line; importing it loads NiceGUI."""

import asyncio
import math
from collections.abc import Callable, Mapping
from typing import Any

from nicegui import events
from nicegui.element import Element

REMEMBERED = 20
"""Questions whose answers are kept: one that was asked again, as its answer was lost, is not done
twice. The page has no more open ones: a key has one at a time."""

Answer = Callable[[Mapping[str, Any]], Mapping[str, Any]]


class Timeline(Element, component="viewer.js"):
    """Draws time line, curves and events, and says which time is to be shown.

    Parameters
    ----------
    about
        What does not change: length, trials, events, gaps, signals.
    show
        Called on the page's own thread with the time that is shown, in seconds from the start;
        returns why it cannot be shown, or nothing.
    answers
        What answers each kind of question, called beside everything else: ``second``, ``lane``,
        ``curve``, ``spectrogram``, ``picture``, ``sound`` and ``mark``.
    """

    def __init__(
        self,
        about: Mapping[str, Any],
        show: Callable[[float], str],
        answers: Mapping[str, Answer],
    ) -> None:
        super().__init__()
        self._props["about"] = dict(about)
        self._show = show
        self._answers = dict(answers)
        self._given: dict[int, Mapping[str, Any] | None] = {}
        self.on("asked", self._asked)

    async def _asked(self, event: events.GenericEventArguments) -> None:
        asked = event.args
        try:
            key, ident, kind = str(asked["key"]), int(asked["ident"]), str(asked["kind"])
            second = float(asked["t"]) if kind == "second" else 0.0
        except (KeyError, OverflowError, TypeError, ValueError):
            return  # no page of ours asks so
        if kind not in self._answers or not math.isfinite(second):
            return
        if ident not in self._given:
            self._given[ident] = None
            why = self._show(second) if kind == "second" else ""
            # Beside everything else: an hour of a signal is read, and a jump waits for nobody.
            try:
                found = await asyncio.to_thread(self._answers[kind], asked)
            except BaseException:  # a repeated request is answered again
                self._given.pop(ident, None)
                raise
            self._given[ident] = {**found, "failed": why} if why else found
            while len(self._given) > REMEMBERED:
                self._given.pop(next(iter(self._given)))
        if (answer := self._given.get(ident)) is not None:  # it is not still under way
            self.run_method("answered", key, ident, dict(answer))
