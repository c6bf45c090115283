"""The scenario task."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from labcrane import FloatArray, Frame, Machine, ProtocolError, Run, Signal, Task, Trial
from labcrane.core import Event, Phase, PlannedTrial, TrialStatus, Value
from labcrane.machines import SCENE_PLACED, Scene, load_scene, place_objects, write_placed
from labcrane_scenario.goals import GoalSequence, check_goals
from labcrane_scenario.mistakes import ENDING, KINDS
from labcrane_scenario.observation import Observation
from labcrane_scenario.settings import ScenarioSettings

PRESSED = 0.5  # a button is 0 or 1
DEFORMITY = "deformity"
NOWHERE = -1.0
"""Distance of a deformity that is not there."""


class Scenario(Task):
    """One run in a scene is one trial: its goals in their order, and the mistakes during the run.

    ``target`` is the goal of the moment, ``target.jaws`` how far the jaws must be open for it (-1
    when it does not matter). ``target.touch`` is 1 when its thing was touched, 0 when it is still
    to be touched, -1 where nothing is. ``goals.reached`` is how many are done,
    ``deformity.distance`` how far the tip is from the deformed limb (-1 where there is none).
    """

    signals = (
        Signal("target.position", "m", ("x", "y", "z")),
        Signal("target.radius", "m"),
        Signal("target.jaws", "1"),
        Signal("target.touch", "1"),
        Signal("goals.reached", "1"),
        Signal("deformity.distance", "m"),
        Signal("mistakes", "1", tuple(KINDS)),
    )

    conditions = (Signal("scenario", "", definition="the scene, by the name of its file"),)

    results = (
        Signal("time", "s", definition="from the trial's start to its end"),
        Signal("goals", "1", definition="goals that were reached"),
        *(Signal(f"n_{kind}", "1", definition=each) for kind, each in KINDS.items()),
        Signal("peak_force.object", "N", definition="largest force on an object"),
        Signal("peak_force.body", "N", definition="largest force on the body"),
        Signal(
            "deformity_found",
            "s",
            definition="from the trial's start to the report of the deformity; NaN without one",
        ),
        Signal(
            "deformity",
            "1",
            definition="1 where there is a deformity, else 0; NaN where the scene never has one",
        ),
        Signal(
            "found",
            "1",
            definition="1 where it was reported, else 0; NaN where the scene never has one",
        ),
        Signal(
            "false_reports",
            "1",
            definition="reports where there is no deformity, or from too far away",
        ),
        Signal(
            "k",
            "1",
            definition="1 if all goals were reached, else 0; the experimenter's completion "
            "overrides it",
        ),
    )

    reports = (DEFORMITY,)

    def __init__(self, settings: ScenarioSettings, machine: Machine) -> None:
        self._settings = settings
        self._machine = machine
        self._scenes: dict[str, Scene] = {}
        for at, path in enumerate(settings.scenes):
            if _name(path) in self._scenes:
                raise ProtocolError(
                    f"two scenes are called {_name(path)!r}; list each once, or rename a file",
                    at=("scenes", at),
                )
            try:
                self._scenes[_name(path)] = load_scene(path)
            except ProtocolError as error:
                raise ProtocolError(str(error), at=("scenes", at)) from error
        for at, (name, scene) in enumerate(self._scenes.items()):
            if scene.start_deg is not None and len(scene.start_deg) != len(machine.joints):
                raise ProtocolError(
                    f"scene {name!r}: start_deg has {len(scene.start_deg)} angles; the machine has "
                    f"{len(machine.joints)} joints ({', '.join(machine.names)})",
                    at=("scenes", at),
                )
        self._values: FloatArray = np.zeros(8 + len(KINDS))

    def factors(self) -> Mapping[str, Sequence[str]]:
        return {"scenes": tuple(self._scenes)}

    def plan(self, levels: Mapping[str, Sequence[str]]) -> Sequence[PlannedTrial]:
        return [self._planned(name, self._scenes[name]) for name in levels["scenes"]]

    def open(self, run: Run) -> None:
        self._run = run
        for name, scene in self._scenes.items():
            check_goals(name, scene, run.state)
        self._button = (
            run.axes.index(self._settings.find_axis) if self._settings.find_axis else None
        )

    def begin_trial(self, trial: Trial) -> None:
        name = str(trial.planned.condition["scenario"])
        scene, settings = self._scenes[name], self._settings
        placed = place_objects(scene, trial.seed)
        self._watch = Observation(settings, self._run, placed)
        self._way = GoalSequence(scene, placed, self._run)
        self._deformed = next((each for each in placed if each.deformed is not None), None)
        self._limb = (self._deformed and self._deformed.deformed) or ""
        self._limit = settings.limit_s or scene.limit_s
        self._most: float = settings.mistakes
        self._asked = scene.figure is not None and scene.figure.deformity is not None
        self._found = math.nan
        self._false = 0
        self._down = False
        self._placed = write_placed(placed)

    def lift_limits(self) -> None:
        self._limit, self._most = math.inf, math.inf

    def evaluate(self, frame: Frame) -> TrialStatus:
        due, state = frame.tick.due, frame.state
        events = [*self._watch.see(state, due), *self._findings(frame)]
        if frame.elapsed == 0.0:
            events.insert(0, Event(SCENE_PLACED, due, {"things": self._placed}))
        events.extend(self._way.see(state, due))
        counts = self._watch.mistakes.counts
        kind = next((name for name in ENDING if counts[name] > self._most), None)
        phase = Phase.RUNNING
        if self._way.done:
            phase = Phase.SUCCESS
        elif kind is not None:
            phase = Phase.FAILURE
            events.append(Event("mistakes.too_many", due, {"kind": kind, "most": self._most}))
        elif frame.elapsed >= self._limit:
            phase = Phase.TIMEOUT
        if phase.over:
            events.extend(self._watch.end(state, due))
        self._values[:] = (*self._way.target(state), self._away(state), *counts.values())
        results = self._results(frame, phase) if phase.over else {}
        return TrialStatus(phase, self._values, tuple(events), results)

    def _planned(self, name: str, scene: Scene) -> PlannedTrial:
        start = tuple(self._machine.rest)
        if scene.start_deg is not None:
            start = tuple(math.radians(angle) for angle in scene.start_deg)
        limit = self._settings.limit_s or scene.limit_s
        return PlannedTrial({"scenario": name}, expected_s=limit / 2, start_pose=start)

    def _away(self, state: FloatArray) -> float:
        """Return how far the tip is from the deformed limb, in m; -1 where there is none."""
        if self._deformed is None:
            return NOWHERE
        return self._way.nearest(state, self._deformed.name, self._limb)

    def _reports(self, frame: Frame) -> Iterator[str]:
        """Yield who reports a deformity in this tick, once for each report."""
        for event in frame.events:
            text = str(event.data.get("text", ""))
            if event.name == "order.note" and text.lower().startswith("found"):
                yield "supervisor"
            elif event.name == "order.report" and event.data["refused"] is None:
                yield "operator" if event.data["by"] == "participant" else "supervisor"
        down = self._button is not None and frame.axes.item(self._button) > PRESSED
        if down and not self._down:
            yield "operator"
        self._down = down

    def _findings(self, frame: Frame) -> Iterator[Event]:
        """Yield every report, what it is worth, and the first that finds the deformity."""
        due = frame.tick.due
        for by in self._reports(frame):
            away = self._away(frame.state)
            near = by == "supervisor" or away <= self._settings.find_m
            worth = "far" if not near else "hit" if math.isnan(self._found) else "again"
            if self._deformed is None:
                worth = "none there"
            self._false += worth in {"far", "none there"}
            about: dict[str, Value] = {"by": by, "worth": worth, "false_reports": self._false}
            yield Event("deformity.reported", due, {**about, "distance": away})
            if worth == "hit":
                self._found = frame.elapsed
                yield Event("deformity.found", due, {"by": by, "limb": self._limb})

    def _results(self, frame: Frame, phase: Phase) -> dict[str, Value]:
        peaks = self._watch.peaks
        return {
            "time": frame.elapsed,
            "goals": float(self._way.reached),
            **self._watch.mistakes.results(),
            "peak_force.object": peaks["object"],
            "peak_force.body": peaks["body"],
            "deformity_found": self._found,
            "deformity": float(self._deformed is not None) if self._asked else math.nan,
            "found": float(not math.isnan(self._found)) if self._asked else math.nan,
            "false_reports": float(self._false),
            "k": float(phase is Phase.SUCCESS),
        }


def _name(path: Path) -> str:
    return path.name.split(".")[0]
