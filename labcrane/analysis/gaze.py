"""Gaze measures, from an external stream of the operator's gaze.

A gaze stream is a stream of LSL type ``Gaze`` with a channel labelled ``aoi``: for each sample the
name of the area of interest that is looked at, or its number from 1; an empty text or 0 for none,
NaN for a blink. A source that has only the gaze position in the window, in pixels, is joined
to the areas that a view recorded with its pictures (``labcrane.feedback.NAME.areas``):
:func:`looks_on_screen`. :mod:`~labcrane.analysis.gaze_streams` selects the stream.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from labcrane.analysis.cohort import Participant
from labcrane.analysis.gaze_streams import (
    CHANNEL,
    MEAN,
    gaze_stream,
    sure_samples,
    window_gaze,
    window_pictures,
    window_stream,
)
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

SIDES = ("left", "top", "right", "bottom")
EYES = "gaze_eyes"
ROUNDING_S = 1e-9
"""Samples that hold for as long as a look lasts make one."""


Pieces = Sequence[tuple[float, float]]
"""From when to when, in s: a time without the pauses in it."""


@dataclass(frozen=True, slots=True)
class Looks:
    """The area that was looked at, sample by sample.

    Attributes
    ----------
    time
        On our clock, in seconds, shape ``(n,)``.
    area
        The area's name; "" for none.
    tracked
        Whether the gaze position is known: not in a blink, nor where tracking was lost.
    areas
        Names of all areas that there were, looked at or not, as far as they are known.
    eyes
        Eyes that were used: ``left and right``; empty where the stream does not state them.
    """

    time: FloatArray
    area: Sequence[str]
    tracked: npt.NDArray[np.bool_]
    areas: Sequence[str]
    eyes: str = ""

    def dwell(self, area: str, pieces: Pieces) -> float:
        """Return for how long ``area`` was looked at in pieces of time, in seconds.

        A sample holds until the next one, at most for twice the usual step: a gap is not a look.
        NaN where no sample has a gaze position.
        """
        held = self._held(pieces)
        if not held[self.tracked].any():
            return math.nan
        return float(held[self._on(area)].sum())

    def valid(self, pieces: Pieces) -> float:
        """Return the share of time with known gaze, 0 to 1; NaN if no time passed."""
        known = float(self._held(pieces)[self.tracked].sum())
        lasts = sum(max(stop - start, 0.0) for start, stop in pieces)
        return min(known / lasts, 1.0) if lasts else math.nan

    def _held(self, pieces: Pieces) -> FloatArray:
        """Return for how long each sample holds in pieces of time, in s, shape ``(n,)``."""
        steps = np.diff(self.time, append=np.nan)
        usual = self._usual
        until = self.time + np.where(np.isnan(steps), usual, np.minimum(steps, 2.0 * usual))
        held = np.zeros(len(self.time))
        for start, stop in pieces:
            held += np.clip(np.minimum(until, stop) - np.maximum(self.time, start), 0.0, None)
        return held

    def first(self, area: str, start: float, stop: float, least_s: float = 0.0) -> float:
        """Return when ``area`` was first looked at from ``start`` to ``stop``; NaN for never.

        A look lasts for ``least_s`` without a sample elsewhere, lost or missing.
        """
        held = self._held([(start, stop)])
        on = self._on(area) & (held > 0.0)
        going_on = np.concatenate([[False], on[:-1] & (np.diff(self.time) <= 2.0 * self._usual)])
        begins = np.flatnonzero(on & ~going_on)
        if not begins.size:
            return math.nan
        lasts = np.add.reduceat(np.where(on, held, 0.0), begins)
        long = begins[lasts >= least_s - ROUNDING_S]
        return max(float(self.time[long[0]]), start) if long.size else math.nan

    def _on(self, area: str) -> npt.NDArray[np.bool_]:
        """Return which samples are known to be on an area, shape ``(n,)``."""
        return np.array([name == area for name in self.area], bool) & self.tracked

    @property
    def _usual(self) -> float:
        """The usual step from sample to sample, in s."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0


def looks(
    session: SessionRecord, delay_s: float = 0.0, stream: str = "", eye: str = MEAN
) -> Looks | None:
    """Return a session's gaze, or None without a stream that can be measured.

    Parameters
    ----------
    delay_s
        Of the display, for a stream of positions in the window: as in
        :func:`looks_on_screen`. With 0, a picture is seen as soon as it is handed to the screen.
    stream
        Name of the gaze stream; the only one by default.
    eye
        Of :func:`~labcrane.analysis.gaze_streams.window_gaze`.
    """
    gaze = gaze_stream(session, stream)
    if gaze is None:
        return None
    if CHANNEL in gaze.units:
        values = gaze.values([CHANNEL])[CHANNEL].tolist()
        names = {value: area_name(value) for value in set(values)}  # each name is kept once
        found = [names[value] for value in values]
        sure, eyes = sure_samples(session, gaze, eye)
        tracked = np.array([not _is_lost(value) for value in values], bool) & sure
        return Looks(gaze.time, found, tracked, sorted({*names.values()} - {""}), eyes)
    pictures = window_pictures(session)
    if pictures is None or not (columns := area_columns(pictures)):
        return None
    where = window_gaze(session, gaze, eye)
    boxes = pictures.values([column for four in columns.values() for column in four])
    things = _things(list(columns))
    areas = {
        things[name]: np.column_stack([boxes[column] for column in four]).astype(np.float64)
        for name, four in columns.items()
    }
    seen = looks_on_screen(gaze.time, where.spots(), pictures.time, areas, delay_s)
    return replace(seen, eyes=where.called)


def area_columns(pictures: Stream) -> dict[str, tuple[str, ...]]:
    """Return the four columns of each area of a view's stream, by ``camera.thing``."""
    columns = set(pictures.units)
    found = {}
    for column in pictures.units:
        name, _, side = column.rpartition(".")
        four = (*(f"{name}.{each}" for each in SIDES),)
        if side == SIDES[0] and columns >= set(four):
            found[name] = four
    return found


def _things(areas: Sequence[str]) -> dict[str, str]:
    """Return the name of each area in a table: its object, with the camera if it has two."""
    things = [name.partition(".")[2] for name in areas]
    alone = len(set(things)) == len(things)
    return {
        name: thing if alone else name.replace(".", "_", 1)
        for name, thing in zip(areas, things, strict=True)
    }


def looks_on_screen(
    time: FloatArray,
    gaze: FloatArray,
    shown: FloatArray,
    areas: Mapping[str, FloatArray],
    delay_s: float,
) -> Looks:
    """Return the area that was looked at in the picture that was on the screen at that moment.

    A picture handed to the screen at ``shown`` is seen from ``shown + delay_s`` on, until the next
    one is; its areas are where the objects were in it, however far they have moved since.

    Parameters
    ----------
    time
        Of the gaze samples, on our clock, in seconds, shape ``(n,)``.
    gaze
        Gaze positions in the window, in pixels, x and y from the upper left corner, shape
        ``(n, 2)``; NaN for a blink.
    shown
        ``flip.time`` of the view's pictures, in seconds, rising, shape ``(m,)``.
    areas
        Left, top, right and bottom of each area in each picture, in pixels, shape ``(m, 4)``; NaN
        while it is not in the picture. Where areas overlap, the smallest is looked at.
    delay_s
        From ``flip.time`` to light, in seconds, as ``labcrane doctor --display`` measures it.

    Raises
    ------
    ValueError
        The delay is not known, or shapes do not fit.
    """
    if not math.isfinite(delay_s):
        raise ValueError(
            "the display's delay is unknown, so gaze cannot be matched to pictures; "
            "measure it with labcrane doctor --display"
        )
    if gaze.shape != (len(time), 2):
        raise ValueError(f"gaze is {gaze.shape}, and {len(time)} times need ({len(time)}, 2)")
    names = list(areas)
    for name in names:
        if areas[name].shape != (len(shown), 4):
            raise ValueError(
                f"area {name!r} is {areas[name].shape}, and {len(shown)} pictures need "
                f"({len(shown)}, 4)"
            )
    if not names or not len(shown):
        return Looks(time, [""] * len(time), np.zeros(len(time), bool), names)
    picture = np.searchsorted(shown + delay_s, time, side="right") - 1
    boxes = np.stack([areas[name] for name in names], axis=1)[np.maximum(picture, 0)]
    left, top, right, bottom = np.moveaxis(boxes, -1, 0)
    x, y = gaze[:, :1], gaze[:, 1:]
    within = (left <= x) & (x <= right) & (top <= y) & (y <= bottom) & (picture >= 0)[:, None]
    sizes = np.where(within, (right - left) * (bottom - top), np.inf)
    smallest = np.argmin(sizes, axis=1)
    found = np.isfinite(sizes[np.arange(len(time)), smallest])
    area = [names[at] if on else "" for at, on in zip(smallest, found, strict=True)]
    tracked = np.isfinite(gaze).all(axis=1) & (picture >= 0)
    return Looks(time, area, tracked, names)


def drift(
    gaze: FloatArray,
    target: tuple[float, float],
    centre: tuple[float, float],
    px_per_m: float,
    viewing_m: float,
) -> dict[str, float]:
    """Return how far gaze is from a fixation target, as angles at the eye.

    They are ``right_deg``, ``down_deg``, ``deg`` and ``spread_deg`` of :data:`FIXATIONS`, the
    directions as seen by a person who looks straight at the target. The eye is in front of the
    screen's ``centre``. Medians: a blink's edge or a short look away moves them little.

    Parameters
    ----------
    gaze
        Samples while the target was looked at, in pixels, shape ``(n, 2)``; NaN for a blink.
    target, centre
        In pixels, from the upper left corner.
    px_per_m
        Pixels in a metre of the glass.
    viewing_m
        From the eye to the screen, in metres.

    Raises
    ------
    ValueError
        No sample is a number.
    """
    there = gaze[np.isfinite(gaze).all(axis=1)]
    if not len(there):
        raise ValueError("no gaze sample was valid during fixation of the target; calibrate again")
    metres = (np.vstack([there, target]) - centre) / px_per_m
    rays = np.column_stack([metres, np.full(len(metres), viewing_m)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    seen, ray = rays[:-1], rays[-1]
    # Beside the screen's middle its rows and columns are not at right angles to the line of sight.
    rightwards = np.cross((0.0, 1.0, 0.0), ray)
    rightwards /= np.linalg.norm(rightwards)
    beyond = seen - ray  # exactly nothing for who looks at the target
    aside = np.column_stack([beyond @ rightwards, beyond @ np.cross(ray, rightwards)])
    sine = np.hypot(aside[:, 0], aside[:, 1])
    angle = np.degrees(np.arctan2(sine, seen @ ray))
    away = aside * (angle / np.where(sine > 0.0, sine, 1.0))[:, None]
    right, down = np.median(away, axis=0).tolist()
    return {
        "right_deg": right,
        "down_deg": down,
        "deg": math.hypot(right, down),
        "spread_deg": float(np.median(np.hypot(away[:, 0] - right, away[:, 1] - down))),
    }


FIXATIONS: Mapping[str, tuple[str, str]] = {
    "step": ("1", "number of the step that checked the eye tracker"),
    "point": ("1", "number of the fixation point"),
    "time": ("s", "when the point appeared, on the session's clock"),
    "right_deg": ("deg", "median offset of gaze from the point, to the right"),
    "down_deg": ("deg", "median offset of gaze from the point, downwards"),
    "deg": ("deg", "size of that offset"),
    "spread_deg": ("deg", "median distance of samples from their median: the precision"),
    "right_px": ("px", "median offset of gaze from the point, to the right"),
    "down_px": ("px", "median offset of gaze from the point, downwards"),
    "valid": ("1", "share of the samples in which gaze is known"),
}
"""Unit and meaning of the columns of :func:`fixations`."""

SETTLED_S = 0.5
"""After a point appears: the eye is on its way for the first third of a second, and settles."""


@dataclass(frozen=True, slots=True)
class Glass:
    """The operator's picture, as its view reported when it was ready.

    Attributes
    ----------
    size
        Width and height, in pixels.
    flip
        Mirroring by the window: ``none``, ``horizontal`` or ``vertical``.
    px_per_m, viewing_m
        Pixels in a metre of it, and the eye's distance in metres; NaN where not given.
    refresh_hz
        Refresh rate of the monitor, in Hz; NaN where unknown.
    """

    size: tuple[int, int]
    flip: str = "none"
    px_per_m: float = math.nan
    viewing_m: float = math.nan
    refresh_hz: float = math.nan

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Return where a share of width and height is, in pixels from the upper left corner."""
        across = 1.0 - x if self.flip == "horizontal" else x
        down = 1.0 - y if self.flip == "vertical" else y
        return across * self.size[0], down * self.size[1]


def fixations(session: SessionRecord) -> "pd.DataFrame":
    """Return how far gaze was from each point of the session's checks of the eye tracker.

    One row of :data:`FIXATIONS` for each point that was shown for its whole time. Offsets in
    degrees are NaN where the picture's size or the eye's distance was not given. No row without an
    operator's view, or without exactly one gaze stream in pixels of the window.
    """
    import pandas as pd

    return pd.DataFrame(_points(session), columns=list(FIXATIONS))


def fixations_of(participant: Participant) -> "pd.DataFrame":
    """Return :func:`fixations` of all sessions, each row with its participant and session."""
    import pandas as pd

    columns = ["participant", "session", *FIXATIONS]
    return pd.DataFrame(participant.rows(_points), columns=columns)


def _points(session: SessionRecord) -> Iterator[dict[str, float]]:
    """Yield the rows of :func:`fixations`."""
    gaze, events = window_stream(session), session.events
    if gaze is None or not (events["name"] == "fixation.over").any():
        return
    spots, seen = window_gaze(session, gaze).spots(), gaze.time
    step, began, glass = 0, 0.0, None
    point: Mapping[str, Any] = {}
    for name, time, data in zip(events["name"], events["time"], events["data"], strict=True):
        match name:
            case "feedback.ready":
                glass = _glass(str(data["facts"])) or glass
            case "step.start":
                step = int(data["step"])
            case "fixation.shown":
                began, point = float(time), data
            case "fixation.over" if data["done"] and point and glass is not None:
                held = (seen >= began + SETTLED_S) & (seen < float(time))
                at = glass.pixel(float(point["x"]), float(point["y"]))
                about = {"step": step, "point": int(point["point"]), "time": began}
                yield about | _offset(spots[held], at, glass)


def glass_of(session: SessionRecord) -> Glass | None:
    """Return the operator's picture; None where there was none, or several that differ."""
    events = session.events
    ready = events.loc[events["name"] == "feedback.ready", "data"]
    found = [glass for data in ready if (glass := _glass(str(data["facts"]))) is not None]
    return found[0] if found and all(str(each) == str(found[0]) for each in found) else None


def _glass(facts: str) -> Glass | None:
    """Return the picture that a view's facts describe; None if it is not the operator's."""
    names = "seen_by|size|flip|px_per_m|viewing_m|refresh_hz(?! not known)"
    told = dict(re.findall(rf"(?:^|, )({names}) (\w[\w.+-]*)", facts))
    size = re.fullmatch(r"(\d+)x(\d+)", told.get("size", ""))
    if told.get("seen_by") != "operator" or size is None:
        return None
    return Glass(
        (int(size[1]), int(size[2])),
        told.get("flip", "none"),
        float(told.get("px_per_m", math.nan)),
        float(told.get("viewing_m", math.nan)),
        float(told.get("refresh_hz", math.nan)),
    )


def _offset(spots: FloatArray, at: tuple[float, float], glass: Glass) -> dict[str, float]:
    """Return the share of samples that are numbers and, as far as known, a row's offsets."""
    there = np.isfinite(spots).all(axis=1)
    if not there.any():
        return {"valid": 0.0}
    right, down = (np.median(spots[there], axis=0) - at).tolist()
    found = {"valid": float(there.mean()), "right_px": right, "down_px": down}
    if math.isfinite(glass.px_per_m + glass.viewing_m):
        middle = (glass.size[0] / 2.0, glass.size[1] / 2.0)
        found |= drift(spots, at, middle, glass.px_per_m, glass.viewing_m)
    return found


def area_name(value: object) -> str:
    """Return the area that a sample of ``aoi`` names; "" for none."""
    if isinstance(value, str):
        return value
    number = float(str(value))
    return "" if np.isnan(number) or number == 0.0 else f"{number:g}"


def _is_lost(value: object) -> bool:
    """Return whether a sample of ``aoi`` says that the area is unknown; a text never does."""
    return not isinstance(value, str) and math.isnan(float(str(value)))


def gaze_measures(
    seen: Looks, started: float, onset: float, offset: float, look_least_s: float = 0.066,
    pauses: Sequence[tuple[float, float]] = (),
) -> dict[str, float]:  # fmt: skip
    """Return how much of gaze is known, and dwell and first look for each area.

    ``gaze_valid_before`` and ``gaze_valid_during`` are the shares of the time from the trial's
    start to onset and from onset to offset in which the gaze position is known.
    ``dwell_before_X`` and ``dwell_during_X`` are the seconds in which that was X: 0 where it was
    not, NaN where that share is 0. ``look_lead_X`` is the time from the first look at X in the
    trial to the movement's onset, in seconds, NaN when X was not looked at before it.

    Parameters
    ----------
    started, onset, offset
        Of trial and movement, on our clock, in seconds.
    look_least_s
        Minimum duration of a first look, in seconds: a shorter one is not a fixation.
    pauses
        When the trial was paused and when it went on, on our clock, in seconds, rising. They are
        excluded from all times, as from all other measures.
    """
    parts = {
        "before": _between(pauses, started, onset),
        "during": _between(pauses, onset, offset),
    }
    found = {f"gaze_valid_{part}": seen.valid(pieces) for part, pieces in parts.items()}
    for area in seen.areas:
        for part, pieces in parts.items():
            found[f"dwell_{part}_{area}"] = seen.dwell(area, pieces)
        found[f"look_lead_{area}"] = _lead(seen, area, parts["before"], look_least_s)
    return found


def _between(pauses: Pieces, start: float, stop: float) -> Pieces:
    within = [(since, until) for since, until in pauses if start < until and since < stop]
    begins = [start, *(until for _, until in within)]
    ends = [*(since for since, _ in within), stop]
    return [(max(begin, start), end) for begin, end in zip(begins, ends, strict=True)]


def _lead(seen: Looks, area: str, pieces: Pieces, least_s: float) -> float:
    """Return the time from the first look at an area to the end of the last piece."""
    for at, (begin, end) in enumerate(pieces):
        first = seen.first(area, begin, end, least_s)
        if not math.isnan(first):
            return end - first + sum(until - since for since, until in pieces[at + 1 :])
    return math.nan


def with_unseen_areas(movements: "pd.DataFrame") -> "pd.DataFrame":
    """Return movements of several recordings with 0 s for areas that only others looked at.

    A stream of area names does not list other areas: an area has a column in the tables of those
    who looked at it. Where tracking was lost it stays NaN.
    """
    filled = {}
    for part in ("before", "during"):
        if f"gaze_valid_{part}" not in movements:
            continue
        known = movements[f"gaze_valid_{part}"] > 0.0
        for name in (str(each) for each in movements if str(each).startswith(f"dwell_{part}_")):
            filled[name] = movements[name].mask(known & movements[name].isna(), 0.0)
    return movements.assign(**filled)


def gaze_units(columns: "pd.Index[str]") -> dict[str, tuple[str, str]]:
    """Return unit and meaning of each gaze measure among ``columns``."""
    found = {}
    for name in columns:
        if name == EYES:
            found[name] = ("", "eyes by which gaze was measured; empty where they are not stated")
        elif name.startswith("gaze_valid_"):
            found[name] = ("1", "share of the time in which the gaze position is known")
        elif name.startswith("dwell_"):
            found[name] = ("s", "gaze on an area of interest; NaN where tracking was lost")
        elif name.startswith("look_lead_"):
            found[name] = ("s", "first look at an area of interest before the onset")
    return found
