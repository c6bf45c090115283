"""Element of a NiceGUI page that draws a recording's time line; importing it loads NiceGUI."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from nicegui import events
from nicegui.element import Element


class Timeline(Element, component="viewer.js"):
    """Draws time line, curves and events, and says which time is to be shown.

    Parameters
    ----------
    about
        What does not change: length, trials, events, gaps, signals.
    at
        Called with the time that is shown, in seconds from the start.
    curve
        Called with stream, column, begin and end; returns what is drawn.
    spectrogram
        The same for its frequencies.
    mark
        Called with what is marked, or which mark is taken back; returns the marks as they are then,
        and what to say.
    glance
        Called with a time, or with begin and end; returns where it is looked at.
    """

    def __init__(
        self,
        about: Mapping[str, Any],
        at: Callable[[float], None],
        curve: Callable[[str, str, float, float], Mapping[str, Any]],
        spectrogram: Callable[[str, str, float, float], Mapping[str, Any]],
        mark: Callable[[Mapping[str, Any]], Mapping[str, Any]],
        glance: Callable[[Mapping[str, Any]], Mapping[str, Any]],
    ) -> None:
        super().__init__()
        self._props["about"] = dict(about)

        async def asked(event: events.GenericEventArguments) -> None:
            told = event.args
            where = str(told["stream"]), str(told["column"])
            # Beside everything else: an hour of a signal is read, and a jump waits for nobody.
            span = float(told["begin"]), float(told["end"])
            how = spectrogram if told.get("as") == "spectrogram" else curve
            found = await asyncio.to_thread(how, *where, *span)
            self.run_method("curve", int(told["at"]), dict(found))

        async def marked(event: events.GenericEventArguments) -> None:
            self.run_method("marked", dict(await asyncio.to_thread(mark, event.args)))

        async def glanced(event: events.GenericEventArguments) -> None:
            self.run_method("glanced", dict(await asyncio.to_thread(glance, event.args)))

        self.on("mark", marked)
        self.on("glance", glanced)
        self.on("at", lambda event: at(float(event.args)))
        self.on("curve", asked)
