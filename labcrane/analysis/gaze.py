"""Gaze measures, from a stream of others that says where the operator looked.

A gaze stream is a stream of LSL type ``Gaze`` with a channel labelled ``aoi``: for each sample the
name of the area of interest that is looked at, or its number from 1; an empty text or 0 for none,
NaN for a blink. Whoever shows the scene knows its areas, so areas are named by the source and not
computed here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from labcrane.recording.participant_file.reader import SessionRecord
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

KIND, CHANNEL = "Gaze", "aoi"


@dataclass(frozen=True, slots=True)
class Looks:
    """What was looked at, sample by sample.

    Attributes
    ----------
    time
        On our clock, in seconds, shape ``(n,)``.
    area
        The area's name; "" for none.
    """

    time: FloatArray
    area: Sequence[str]

    def dwell(self, area: str, start: float, stop: float) -> float:
        """Return for how long ``area`` was looked at from ``start`` to ``stop``, in seconds.

        A sample holds until the next one, at most for twice the usual step: a gap is no look.
        """
        steps = np.diff(self.time, append=np.nan)
        usual = float(np.nanmedian(steps)) if len(steps) > 1 else 0.0
        until = self.time + np.where(np.isnan(steps), usual, np.minimum(steps, 2.0 * usual))
        inside = np.minimum(until, stop) - np.maximum(self.time, start)
        on = np.array([name == area for name in self.area])
        return float(np.clip(inside[on], 0.0, None).sum())

    def first(self, area: str, start: float, stop: float) -> float:
        """Return when ``area`` was first looked at from ``start`` to ``stop``; NaN for never."""
        during = (self.time >= start) & (self.time < stop)
        on = np.array([name == area for name in self.area])
        found = np.flatnonzero(during & on)
        return float(self.time[found[0]]) if found.size else float("nan")


def looks(session: SessionRecord) -> Looks | None:
    """Return what a session's gaze stream says, or None when it has none."""
    for stream in session.streams.values():
        if stream.attrs.get("type") == KIND and CHANNEL in stream.data:
            return Looks(stream.time, [_name(value) for value in stream.data[CHANNEL]])
    return None


def _name(value: object) -> str:
    if isinstance(value, str):
        return value
    number = float(str(value))
    return "" if np.isnan(number) or number == 0.0 else f"{number:g}"


def gaze_measures(seen: Looks, started: float, onset: float, offset: float) -> dict[str, float]:
    """Return dwell and first look for each area.

    ``dwell_before_X`` and ``dwell_during_X`` are the seconds from the trial's start to onset and
    from onset to offset; ``look_lead_X`` is the time from the first look at X in the trial to the
    movement's onset, in seconds, NaN when X was not looked at before it.

    Parameters
    ----------
    started, onset, offset
        Of trial and movement, on our clock, in seconds.
    """
    found = {}
    for area in sorted(set(seen.area) - {""}):
        found[f"dwell_before_{area}"] = seen.dwell(area, started, onset)
        found[f"dwell_during_{area}"] = seen.dwell(area, onset, offset)
        found[f"look_lead_{area}"] = onset - seen.first(area, started, onset)
    return found


def gaze_units(columns: "pd.Index[str]") -> dict[str, str]:
    """Return the unit of each gaze measure among ``columns``."""
    return {name: "s" for name in columns if name.startswith(("dwell_", "look_lead_"))}
