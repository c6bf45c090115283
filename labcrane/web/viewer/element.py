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
    """

    def __init__(
        self,
        about: Mapping[str, Any],
        at: Callable[[float], None],
        curve: Callable[[str, str, float, float], Mapping[str, Any]],
        spectrogram: Callable[[str, str, float, float], Mapping[str, Any]],
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

        self.on("at", lambda event: at(float(event.args)))
        self.on("curve", asked)
