"""Film of a recorded session: its frames at any time, its events, and its signals as curves.

An hour is never held in memory: of frames some seconds about the time that is shown, of signals the
one that is drawn, and only while it is summed up.
"""

from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from labcrane.analysis.gaze_streams import unmeasured
from labcrane.core.records import Event, Run, SessionState
from labcrane.core.roles import Cue, Feedback
from labcrane.core.signals import Layout, signals_of
from labcrane.design.counts import TrialCounts
from labcrane.errors import LabcraneError, RecordingError, suggestion
from labcrane.files.yaml import parse_yaml
from labcrane.machines.links import link_boxes
from labcrane.machines.machine import Machine
from labcrane.protocol.components import ComponentSpec
from labcrane.recording.films.footage import Footage, footage
from labcrane.recording.participant_file.reader import SessionRecord, Stream
from labcrane.recording.pictures import CAPTURED, LEVEL
from labcrane.registry.registry import Registry
from labcrane.streams.context import situation_after
from labcrane.types import FloatArray
from labcrane.web.control_room.sentences import sentence
from labcrane.web.viewer.glances import Glances

GROUPS = ("loop", "input", "command", "state", "task")
FRAME = {"loop": "", "input": "axes."}
"""What a column of a frame is called there, by group; the others by the group's name."""

WINDOW_S = 20.0
"""How much of the frames is read at once."""

POINTS = 600
"""How many steps a curve has, each with the lowest and highest value in it."""

STEPS = 300
"""How many steps a spectrogram has."""

WINDOW_SAMPLES = 256
RANGE_DB = 80.0
"""What is fainter than the loudest by more is shown as silence."""

KEPT = 6
"""Signals that are kept while they are looked at."""

GAP_S = 0.1
"""A pause between two ticks that is longer is shown as a gap."""

MOST_EVENTS = 20_000

BREAKS = {
    "pause.start": ("pause.end", "by"),
    "input.lost": ("input.back", ""),
    "disk.lost": ("disk.back", ""),
    "stream.lost": ("stream.back", "what"),
    "feedback.lost": ("feedback.ready", "what"),
}
"""Events that begin a pause or a loss: what ends it, and which of their data says whose it is."""


class Film:
    """A session as it can be looked at. Times are seconds from its first frame.

    Parameters
    ----------
    record
        The session.
    called
        What it is called beside another one.
    place
        Participant file, in its place, and session: where marks are kept. None where nobody may
        make any.

    Attributes
    ----------
    run
        What was run, as far as drawing it needs; it cannot be steered.
    shift
        How many seconds later than another film beside it this one is shown.
    """

    def __init__(
        self, record: SessionRecord, called: str, place: tuple[Path, int] | None = None
    ) -> None:
        self.called = called
        self.place = place
        self.shift = 0.0
        self._record = record
        try:
            self._own: Mapping[str, Stream] = {name: record.streams[name] for name in GROUPS}
        except KeyError as error:
            raise RecordingError(
                f"{called} has no frames of {error}, so there is nothing to show"
            ) from None
        self.time: FloatArray = self._own["loop"].time
        if not len(self.time):
            raise RecordingError(f"{called} has no frame, so there is nothing to show")
        self.start = float(self.time[0])
        self.length = float(self.time[-1]) - self.start
        context = record.context
        text = parse_yaml(context["machine"], "the machine as it was", recorded=True)
        self.machine = Machine.model_validate(text)
        self.run = Run(
            rate_hz=float(context["rate_hz"]),
            machine=self.machine,
            participant_seed=0,
            inverse=_nobody,
            bodies=link_boxes(self.machine),
            axes=self._layout("input"),
            command=self._layout("command"),
            state=self._layout("state"),
            task=self._layout("task"),
        )
        self._counts = TrialCounts.recorded(context.get("plan", ()))
        self._window = (0, 0)
        self._rows: dict[str, FloatArray] = {}
        self._reading = Lock()  # each curve is asked for by a thread of its own
        self._curves: OrderedDict[tuple[str, str], tuple[FloatArray, FloatArray]] = OrderedDict()

    def _layout(self, group: str) -> Layout:
        units = self._own[group].units
        return Layout(group, signals_of(list(units), units))

    def index(self, at: float) -> int:
        """Return the newest frame at a time, or the first one."""
        found = int(np.searchsorted(self.time, self.start + at + 1e-9, side="right")) - 1
        return min(max(found, 0), len(self.time) - 1)

    def frame(self, at: float) -> dict[str, float]:
        """Return the newest frame at a time, by the columns of a frame stream."""
        row = self.index(at)
        first, last = self._window
        if not first <= row < last:
            span = round(WINDOW_S * self.run.rate_hz)
            first = max(0, row - span // 4)
            last = min(len(self.time), first + span)
            self._rows = {
                FRAME.get(group, f"{group}.") + name: values
                for group, stream in self._own.items()
                for name, values in stream.rows(first, last).items()
            }
            self._window = (first, last)
        return {name: float(values[row - first]) for name, values in self._rows.items()}

    def situation(self, at: float) -> SessionState:
        """Return what the session was about at a time."""
        times = self._times
        last = int(np.searchsorted(times, self.start + at + 1e-9, side="right"))
        return self._situations[last]

    @cached_property
    def _happened(self) -> list[Event]:
        table = self._record.events.sort_values("time", kind="stable")
        return [
            Event(str(name), float(time), data)
            for name, time, data in zip(table["name"], table["time"], table["data"], strict=True)
        ]

    @cached_property
    def _times(self) -> FloatArray:
        return np.array([event.time for event in self._happened])

    @cached_property
    def _situations(self) -> list[SessionState]:
        found = [SessionState()]
        for event in self._happened:
            found.append(situation_after(found[-1], event))
        return found

    @cached_property
    def events(self) -> list[dict[str, Any]]:
        """What happened, in words, ready for JSON."""
        found = []
        for event in self._happened[:MOST_EVENTS]:
            said = sentence(event, self._called)
            found.append(
                {"t": round(event.time - self.start, 4), "text": said.text, "kind": said.kind,
                 "level": said.level}
            )  # fmt: skip
        return found

    def _called(self, number: int) -> str:
        """Return what screens called a trial, and its number in the tables where that differs."""
        counts = self._counts
        if number not in counts.counted and number not in counts.practice:
            return counts.name(number) if counts.total else f"trial {number}"
        name = counts.name(number)
        return name if counts.counted.get(number) == number else f"{name} ({number} in the tables)"

    @cached_property
    def trials(self) -> list[dict[str, Any]]:
        """When each attempt at a trial was, and how it ended, ready for JSON."""
        found: list[dict[str, Any]] = []
        for event in self._happened:
            at = round(event.time - self.start, 4)
            if event.name == "trial.start":
                found.append(
                    {"from": at, "to": self.length, "trial": event.data["trial"],
                     "attempt": event.data["attempt"], "outcome": "unfinished",
                     "counted": bool(event.data.get("counted"))}
                )  # fmt: skip
            elif event.name == "trial.end" and found:
                found[-1] |= {"to": at, "outcome": event.data["outcome"]}
        return found

    def start_of(self, trial: int) -> float:
        """Return when the newest attempt at a trial began.

        Raises
        ------
        RecordingError
            There was none.
        """
        begun = [one["from"] for one in self.trials if one["counted"] and one["trial"] == trial]
        if not begun:
            there = sorted({one["trial"] for one in self.trials if one["counted"]})
            known = f"{there[0]} to {there[-1]}" if there else "none"
            raise RecordingError(f"{self.called} has no trial {trial}; there are {known}")
        return float(begun[-1])

    def time_of(self, place: str) -> float:
        """Return the second that is meant: a number, or the first event of a name.

        Raises
        ------
        RecordingError
            It is neither.
        """
        with suppress(ValueError):
            return float(place)
        times = [event.time for event in self._happened if event.name == place]
        if not times:
            names = sorted({event.name for event in self._happened})
            raise RecordingError(f"{self.called}: {suggestion(place, names, 'its events are')}")
        return times[0] - self.start

    @cached_property
    def gaps(self) -> list[tuple[float, float]]:
        """From when to when no frame was recorded."""
        steps = np.diff(self.time)
        at = np.flatnonzero(steps > max(GAP_S, 2.5 / self.run.rate_hz))
        return [
            (float(self.time[one] - self.start), float(self.time[one + 1] - self.start))
            for one in at.tolist()
        ]

    @cached_property
    def breaks(self) -> list[dict[str, Any]]:
        """Each pause and each loss of controls, feedback or a stream, ready for JSON.

        One that has not ended lasts until the end of the session.
        """
        found: list[dict[str, Any]] = []
        lasting: dict[tuple[str, Any], dict[str, Any]] = {}
        ends = dict(BREAKS.values())
        for event in self._happened:
            at = round(event.time - self.start, 4)
            if event.name in BREAKS:
                end, whose = BREAKS[event.name]
                key = end, event.data.get(whose)
                if key not in lasting:
                    kind = "paused" if event.name == "pause.start" else "lost"
                    text = sentence(event, self._called).text
                    lasting[key] = {"from": at, "to": self.length, "kind": kind, "text": text}
                    found.append(lasting[key])
            elif event.name in ends:
                key = event.name, event.data.get(ends[event.name])
                if key in lasting:
                    lasting.pop(key)["to"] = at
        return found

    @cached_property
    def glances(self) -> Glances:
        """Where the operator looked, if that was recorded."""
        return Glances(self._record, self.start)

    @cached_property
    def footage(self) -> dict[str, Footage]:
        """What was filmed, by the names of the recordings; their files are in the film's place."""
        if self.place is None:
            return {}
        file, session = self.place
        return footage(self._record.streams, file.absolute().parent, session)

    @cached_property
    def unmeasured(self) -> list[tuple[str, str]]:
        """Gaze streams that are not shown, and why."""
        return unmeasured(self._record)

    @cached_property
    def signals(self) -> list[dict[str, str]]:
        """Every signal that can be drawn: of the session, of other streams, and levels of films."""
        levels = [
            {"stream": CAPTURED + name, "column": LEVEL, "unit": "1", "label": f"{name} {LEVEL}"}
            for name in self.footage
        ]
        return levels + [
            {"stream": stream, "column": column, "unit": unit, "label": f"{stream} {column}"}
            for stream, each in self._record.streams.items()
            for column, unit in each.units.items()
            if stream != "loop" or column not in {"tick", "due", "woke"}
        ]

    def curve(self, stream: str, column: str, begin: float, end: float) -> dict[str, Any]:
        """Return a signal between two times: for each step its lowest and highest value.

        Where there is no value in a step, or none that is a number, it is None: a gap stays one.
        """
        time, values = self._signal(stream, column)
        edges = np.linspace(begin, end, POINTS + 1)
        places = np.searchsorted(time, edges)
        low: list[float | None] = []
        high: list[float | None] = []
        for first, last in zip(places[:-1].tolist(), places[1:].tolist(), strict=True):
            part = values[first:last]
            part = part[np.isfinite(part)]
            low.append(float(part.min()) if len(part) else None)
            high.append(float(part.max()) if len(part) else None)
        return {"low": low, "high": high}

    def spectrogram(self, stream: str, column: str, begin: float, end: float) -> dict[str, Any]:
        """Return how loud each frequency of a signal is between two times, as levels of 0 to 255.

        Each step holds the power spectral density (Hann window, without the mean) of
        ``WINDOW_SAMPLES`` samples at its middle, in decibels: 255 is the loudest, 0 is ``RANGE_DB``
        below it. A step with a gap, or without a number, is None.
        """
        from scipy.signal import periodogram  # noqa: PLC0415 - loads for a second

        time, values = self._signal(stream, column)
        first, last = np.searchsorted(time, (begin, end)).tolist()
        count = last - first
        if count < 2 * WINDOW_SAMPLES:
            raise RecordingError(
                f"a spectrogram needs {2 * WINDOW_SAMPLES} samples, and {stream} {column} has "
                f"{count} there; show a longer time"
            )
        rate_hz = 1.0 / float(np.median(np.diff(time[first:last])))
        starts = np.linspace(first, last - WINDOW_SAMPLES, STEPS).astype(np.intp)
        windows = values[starts[:, None] + np.arange(WINDOW_SAMPLES)]
        spans = time[starts + WINDOW_SAMPLES - 1] - time[starts]
        whole = np.isfinite(windows).all(axis=1) & (spans < 1.1 * WINDOW_SAMPLES / rate_hz)
        if not whole.any():
            return {"levels": [None] * STEPS, "top_hz": rate_hz / 2.0, "most_db": None}
        _, density = periodogram(windows[whole], rate_hz, window="hann", detrend="constant")
        decibels = 10.0 * np.log10(np.maximum(density[:, 1:], np.finfo(float).tiny))
        most = float(decibels.max())
        scaled = np.clip(1.0 + (decibels - most) / RANGE_DB, 0.0, 1.0)
        levels: list[list[int] | None] = [None] * STEPS
        for at, row in zip(np.flatnonzero(whole).tolist(), scaled, strict=True):
            levels[at] = np.rint(255.0 * row).astype(int).tolist()
        return {"levels": levels, "top_hz": rate_hz / 2.0, "most_db": most}

    def _signal(self, stream: str, column: str) -> tuple[FloatArray, FloatArray]:
        with self._reading:
            return self._signal_kept(stream, column)

    def _signal_kept(self, stream: str, column: str) -> tuple[FloatArray, FloatArray]:
        key = stream, column
        if key not in self._curves:
            if len(self._curves) >= KEPT:
                self._curves.popitem(last=False)
            if column == LEVEL and stream.startswith(CAPTURED):
                time, level = self.footage[stream.removeprefix(CAPTURED)].level()
                self._curves[key] = time - self.start, level
                return self._curves[key]
            source = self._record.streams[stream]
            values = source.column(column)
            if values.dtype.kind not in "fiub":  # texts have no curve
                values = np.full(len(values), np.nan)
            self._curves[key] = source.time - self.start, values.astype(np.float64)
        self._curves.move_to_end(key)
        return self._curves[key]

    def cues(self, registry: Registry) -> tuple[dict[str, ComponentSpec], list[str]]:
        """Return what draws the recorded cues, and why some of them cannot be drawn."""
        found, lacking = {}, []
        for name, use, settings in self._recorded_cues():
            if Feedback in registry.roles(use):
                continue  # a sound, which no picture shows
            try:
                offer = registry.find(Cue, use)
                was = offer.settings.model_validate(settings)
                found[name] = ComponentSpec(use, "", offer, was)
            except (LabcraneError, ValueError) as error:
                lacking.append(f"cue {name!r} is not shown: {str(error).partition(chr(10))[0]}")
        return found, lacking

    def _recorded_cues(self) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
        used = {"+".join(state.active) for state in self._situations}
        active = {name for names in used for name in names.split("+") if name}
        for part, about in self._record.context["components"].items():
            name = part.rpartition(".")[2]
            if part.startswith("feedback.") and name in active:
                yield name, about["use"], about["settings"]


def _nobody(velocity: FloatArray, state: FloatArray) -> FloatArray:
    raise RecordingError("a recorded session cannot be steered; it can only be viewed")
