"""Ticks and pictures of the rescue scenarios, compared with those of the kinematic study.

    python -m benchmarks.scenario

The kinematic study is a crane without an engine and an aiming task; the scenarios are those of
``protocols/retrieval``, led by their simulated operator: the casualty, who has joints, from before
the grip to the carrying, the canister, and the reach over rubble to a mesh with a hollow. What a
tick takes is what the loop's thread works in it, so that others on the computer do not count.
Rounds alternate, so that a wandering machine moves all figures together. A picture is one camera's,
of either study, of the same size.
"""

import gc
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.table import Row, show
from benchmarks.tick import STUDY, UntilTick
from labcrane import Frame, Run
from labcrane.core import SessionState
from labcrane.core.clock import ManualClock
from labcrane.design.plan import plan_session
from labcrane.machines import load_scene, place_objects, write_placed
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study, load
from labcrane.recording.frame_log import FrameLog, columns
from labcrane.recording.journal import SessionJournal
from labcrane.registry.registry import discover
from labcrane.session import loop
from labcrane.session.sequencer import Sequencer
from labcrane_view.settings import CameraSettings, ViewSettings
from labcrane_view.view import View

RETRIEVAL = Path(__file__).parents[1] / "protocols" / "retrieval"
RATE_HZ = 240
ROUNDS, WARM_UP = 2, 200
TICKS = {"kinematic": 4800, "casualty": 7200, "carry": 4800, "reach_over": 4800}
PICTURES = 10
SIZE = (960, 540)

LIMITS = {"casualty": 55.0, "carry": 21.0, "reach_over": 15.0}
"""How much longer than a tick of the kinematic study one of a scenario may take, in the median.

The engine's objects need more of the processor's cache than that study: on one computer, the ratio
of the casualty was 28 and 40, depending on what its neighbours did."""

HELD = 0.8
"""Share of a tick's length that 99 % of ticks may take: the rate is held, with room."""

PICTURE = 1.65
"""How much longer a picture of a scenario may take than one of the kinematic study."""

SCENARIO = """\
labcrane: 1
study: scenario
title: One scenario
rate_hz: {rate}
machine: ied_arm.yaml
input: {{use: scenario_operator}}
scheme: {{use: valve, model: arm.dmd.yaml}}
dynamics:
  {{use: dmd_arm, model: arm.dmd.yaml, proportional: [base], jaws: {{grip_n: 60, squeeze_n: 20}},
   scenes: [scenes/{name}.yaml]}}
tasks:
  rescue: {{use: scenario, scenes: [scenes/{name}.yaml]}}
sessions:
  - name: only
    steps:
      - block: {{task: rescue}}
"""


def studies(folder: Path) -> dict[str, Study]:
    """Return the kinematic study, and one of each scenario that is measured."""
    shutil.copytree(RETRIEVAL, folder / "study", ignore=shutil.ignore_patterns("hydraulic_arm"))
    found = {}
    for name in TICKS:
        text = SCENARIO.format(rate=RATE_HZ, name=name)
        if name == "kinematic":
            text = STUDY.format(rate=RATE_HZ).replace("bullet_crane", "kinematic_crane")
            text = text.replace("dual_joystick", "simulated_operator")
        path = folder / "study" / f"{name}.yaml"
        path.write_text(text, encoding="utf-8")
        found[name] = load(path, discover())
    return found


def times(study: Study, folder: Path, count: int) -> tuple[np.ndarray, Frame, Run]:
    """Run whole ticks; return the work of each in s, and the last frame as it was recorded."""
    plan = plan_session(study, "P001", 1)
    rig = Rig.build(study, simulated=False)
    ends: list[float] = []
    last: list[Frame] = []

    def end_of_tick(frame: Frame) -> None:
        ends.append(time.thread_time())
        last[:] = [frame]

    with rig.opened(study, plan.seed) as run:
        path = folder / f"{time.perf_counter_ns()}.xdf"
        with SessionJournal(path, columns(run), run.rate_hz) as journal:
            sequencer = Sequencer(study, plan, rig, waits=False)
            loop.run(
                rig, run, sequencer, ManualClock(), UntilTick(count), FrameLog(journal, run),
                (end_of_tick,),
            )  # fmt: skip
        path.unlink()
    return np.diff(ends)[WARM_UP:], last[0], run


def rows(*, brief: bool = False) -> list[Row]:
    """Return the times of scenarios' ticks and pictures, relative to the kinematic study."""
    rounds, ticks = (1, dict.fromkeys(TICKS, 2 * WARM_UP)) if brief else (ROUNDS, TICKS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        there = studies(folder)
        taken: dict[str, list[np.ndarray]] = {each: [] for each in there}
        frames: dict[str, tuple[Frame, Run]] = {}
        for _ in range(rounds):
            for each, study in there.items():
                gc.collect()
                took, *frames[each] = times(study, folder, ticks[each])
                taken[each].append(took)
        return [*tick_rows(taken), picture_row(there, frames)]


def tick_rows(taken: dict[str, Sequence[np.ndarray]]) -> list[Row]:
    """Return the rows of ticks, from the times of all rounds in s."""
    bare = 1e6 * float(np.median([np.median(each) for each in taken["kinematic"]]))
    found = []
    for name, limit in LIMITS.items():
        middle, most = (
            float(np.median([np.quantile(each, share) for each in taken[name]]))
            for share in (0.5, 0.99)
        )
        kinematic = "a tick of the kinematic study"
        found.append(Row("scenario", f"{name}, median us", 1e6 * middle, bare, kinematic, limit))
        length = 1e3 / RATE_HZ
        found.append(
            Row("scenario", f"{name}, 99 %, ms", 1e3 * most, length, "the tick's length", HELD)
        )
    return found


def picture_row(there: dict[str, Study], frames: dict[str, tuple[Frame, Run]]) -> Row:
    """Return what a picture of the casualty takes beside one of the kinematic study."""
    camera = CameraSettings(eye=(-2.6, 1.0, 3.6), look=(1.0, -0.3, 0.1), fov_deg=60.0)
    views: dict[str, View] = {}
    took: dict[str, list[float]] = {"kinematic": [], "casualty": []}
    try:
        for name in took:
            frame, run = frames[name]
            view = views[name] = View(
                ViewSettings(display="hidden", size=SIZE, camera=camera), run.machine
            )
            view.open(run)
            view.update(SessionState(scene="" if name == "kinematic" else placed(name)))
            seconds(view, frame)  # warms up
        for _ in range(ROUNDS + 1):
            for name, view in views.items():
                took[name].append(seconds(view, frames[name][0]))
    finally:
        for view in views.values():
            view.close()
    ours, bare = (1e3 * float(np.median(took[name])) for name in ("casualty", "kinematic"))
    what = "a picture of the casualty, ms"
    return Row("scenario", what, ours, bare, "one of the kinematic study", PICTURE)


def placed(name: str) -> str:
    """Return the objects of a scenario in the form in which sessions send them to views."""
    return write_placed(place_objects(load_scene(RETRIEVAL / "scenes" / f"{name}.yaml"), 1))


def seconds(view: View, frame: Frame) -> float:
    """Return how long a picture takes, in s."""
    began = time.perf_counter()
    for _ in range(PICTURES):
        view.present(frame)
    return (time.perf_counter() - began) / PICTURES


if __name__ == "__main__":
    show(rows())
