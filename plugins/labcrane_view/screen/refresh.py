"""Refresh of the screen: how often it shows a picture, and whether pictures wait for it."""

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from labcrane import DeviceError
from labcrane.core import Value
from labcrane_view.quality import intervals_s
from labcrane_view.screen.monitors import monitors, refresh_rates
from labcrane_view.screen.window import BACK_BUFFERS, Window
from labcrane_view.settings import ViewSettings

WARM, MEASURED = 3, 24
"""Pictures before the swaps are measured, and those that are."""

NEAR, MOST = 0.1, 0.8
"""How near to a whole number of refreshes, in refreshes, intervals are that waited, and how many of
them are. Of intervals that waited for nothing one in five is as near by chance."""

UNKNOWN = math.nan


@dataclass(frozen=True, slots=True)
class Refresh:
    """What is known of how pictures get onto the glass.

    Attributes
    ----------
    rate_hz
        Refreshes of the monitor per second; NaN where none is known, as of a virtual screen.
    waits
        Whether a picture is shown at a refresh and not between two; None where it is not known.
    buffers
        Pictures in memory: with one, a half-drawn picture is seen.
    """

    rate_hz: float = UNKNOWN
    waits: bool | None = None
    buffers: int = 2

    @property
    def tearing(self) -> str:
        """Whether parts of two pictures may be seen at once, in words."""
        if self.buffers < 2:  # noqa: PLR2004 - one that is shown, and one that is drawn
            return "possible, and half-drawn pictures too: there is one buffer"
        if self.waits is None:
            return "not known: the monitor's refresh rate is not"
        return "not possible: pictures wait for the refresh" if self.waits else "possible"

    def missed(self, interval_s: float) -> float:
        """Return how many refreshes repeated the previous picture; NaN if this is unknown."""
        if not self.waits:
            return math.nan
        return max(0.0, round(interval_s * self.rate_hz) - 1.0)

    def facts(self) -> dict[str, Value]:
        """Return the facts for the record."""
        rate: Value = "not known" if math.isnan(self.rate_hz) else self.rate_hz
        return {"refresh_hz": rate, "buffers": self.buffers, "tearing": self.tearing}


def waited(intervals_s: Sequence[float], rate_hz: float) -> bool | None:
    """Return whether intervals between pictures are whole numbers of refreshes.

    Parameters
    ----------
    intervals_s
        Between two returns of the swap, in seconds.
    rate_hz
        Refresh rate of the monitor; if it is NaN, the result is None.
    """
    if math.isnan(rate_hz):
        return None
    each = [interval * rate_hz for interval in intervals_s]
    near = [round(turns) >= 1 and abs(turns - round(turns)) <= NEAR for turns in each]
    return statistics.fmean(near) >= MOST


def measured(
    draw: Callable[[], None],
    rate_hz: float,
    buffers: int,
    now: Callable[[], float] = time.perf_counter,
) -> Refresh:
    """Draw some pictures, and return how they get onto the glass."""
    if math.isnan(rate_hz):
        return Refresh(buffers=buffers)
    intervals = intervals_s(draw, WARM, MEASURED, now)
    return Refresh(rate_hz, waited(intervals, rate_hz), buffers)


def refresh_of(settings: ViewSettings, window: Window) -> Refresh:
    """Return how a window's pictures get onto the glass, after some that are drawn to see it."""
    if settings.display == "hidden":
        return Refresh(buffers=1 + BACK_BUFFERS)
    form = window.output.get_fb_properties()
    # The software renderer hands over whole pictures, from memory of its own.
    buffers = 1 + form.get_back_buffers() if window.shaders else 2
    return measured(window.engine.render_frame, _rate_hz(settings), buffers)


def _rate_hz(settings: ViewSettings) -> float:
    """Return the slowest refresh of the monitors that a view fills; NaN where none is known."""
    try:
        rates = refresh_rates()
        names = [monitor.name for monitor in monitors()]
    except DeviceError:
        return UNKNOWN
    filled = [names[one] if isinstance(one, int) else one for one in settings.all_screens]
    known = [rate for name, rate in rates if rate > 0.0 and (name in filled or not filled)]
    return min(known, default=UNKNOWN)
