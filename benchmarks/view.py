"""Frame time of the view beside a bare Panda3D scene of the same triangles, and its delay.

    python -m benchmarks.view

The bare scene is the same stage, its shader and shadows, drawn again without anything having
changed. The view besides places machine and cues, writes text, and computes areas of interest.
Rounds alternate, so that a wandering machine moves both figures together. The delay is counted in
frames: every frame has a colour of its own, and the colour that the window has after each is read.
A view sends pictures to the experimenter's page a few times a second; a frame whose picture is sent
is compared with one whose picture is not. A thread of its own codes it, in the time shown.
"""

import time
from dataclasses import replace

import numpy as np

from benchmarks.table import Row
from labcrane import Run
from labcrane.core import SessionState, Sphere
from labcrane.machines.machine import Body
from labcrane.streams.pictures import png
from labcrane.testing import TARGETS, ch8, make_run, make_target
from labcrane_view.settings import ViewSettings
from labcrane_view.view import View

ROUNDS, PICTURES = 7, 20
PROMISED = 30.0
"""Pictures a second, with terrain and the crane's shadow, without a graphics card."""

LIMITS = {"auto": (1.3, 1.4), "software": (1.6, 1.9)}
"""How much longer a picture may take than the bare scene, and one that is sent than another."""


def a_scene() -> Run:
    """Return a crane of boxes and a task with two targets."""
    machine = ch8()
    boxes = [
        Body(joint.name, frame, (joint.a or 0.5, 0.3, 0.3), (-0.5 * joint.a, 0.0, 0.0))
        for frame, joint in enumerate(machine.joints, start=1)
    ]
    return replace(make_run(machine, task=TARGETS), bodies=tuple(boxes))


def rows(*, brief: bool = False) -> list[Row]:
    """Print and return both figures for either renderer."""
    rounds = 1 if brief else ROUNDS
    run, found = a_scene(), []
    for renderer in ("auto", "software"):
        settings = ViewSettings(display="hidden", renderer=renderer, supervisor={"rate_hz": 10})
        view = View(settings, run.machine)
        view.open(run)
        view.update(SessionState(block=1, block_name="benchmark", trial=1, trials=1))
        print(f"{view.metadata()['renderer']}, {view.metadata()['size']}")
        shown = [_seconds(view, run, whole=True)]  # warms up
        shown, bare = [], []
        for _ in range(rounds):
            shown.append(_seconds(view, run, whole=True))
            bare.append(_seconds(view, run, whole=False))
        ratio = np.median(shown) / np.median(bare)
        print(f"  view       {1000 * np.median(shown):6.2f} ms a picture")
        print(f"  bare scene {1000 * np.median(bare):6.2f} ms a picture; ratio {ratio:.2f}")
        behind = _delay(view, run)
        print(f"  delay      {behind} frames")
        what = f"pictures until a frame is seen, {renderer} renderer"
        found.append(Row("view", what, 1.0 + behind, 1.0, "the next one", 1.0))
        sent, unsent, coded = (1000 * figure for figure in _sent(view, run))
        print(
            f"  sent       {sent:6.2f} ms a picture, else {unsent:.2f} ms; coded in {coded:.2f} ms"
        )
        view.close()
        what = f"a picture, {renderer} renderer, ms"
        ours, least = 1000 * float(np.median(shown)), 1000 * float(np.median(bare))
        limits = LIMITS[renderer]
        found.append(Row("view", what, ours, least, "the bare scene", limits[0]))
        if renderer == "auto":
            what = "a whole picture of 1280x720 in medium quality, ms"
            found.append(Row("view", what, ours, 1000.0 / PROMISED, "30 a second", 1.0))
        what = f"a picture that is sent, {renderer} renderer, ms"
        found.append(Row("view", what, sent, unsent, "one that is not", limits[1]))
    return found


def _seconds(view: View, run: Run, *, whole: bool) -> float:
    began = time.perf_counter()
    for number in range(PICTURES):
        if whole:
            view.present(make_target(run, number))
        else:
            view.redraw()
    return (time.perf_counter() - began) / PICTURES


def _sent(view: View, run: Run) -> tuple[float, float, float]:
    """Return how long a picture takes that is sent, one that is not, and the coding, in s."""
    seconds = []
    for number in range(PICTURES):
        frame = make_target(run, 24 * number)  # a tenth of a second each: every one is due
        moments = [time.perf_counter()]
        view.present(frame)
        moments.append(time.perf_counter())
        view.present(frame)
        (picture,) = view.pictures().values()
        moments.append(time.perf_counter())
        png(picture.pixels)
        moments.append(time.perf_counter())
        seconds.append(np.diff(moments))
    unsent, sent, coded = np.median(seconds, axis=0).tolist()
    return sent, unsent, coded


def _delay(view: View, run: Run) -> int:
    """Return the most frames by which the window was behind."""
    levels, behind = [], []
    for repeat in (3, 1):  # first what each colour looks like, then whether it is there at once
        for number in range(16):
            frame = make_target(run, number)
            wall = (0.0, 0.0, (number + 5) / 21, 1.0)
            frame.shapes = (Sphere("wall", (-1.0, 1.9, 3.0), 0.9, wall),)
            for _ in range(repeat):
                view.present(frame)
            height, width, _ = view.picture().shape
            level = int(view.picture()[height // 2, width // 2].sum())
            if repeat > 1:
                levels.append(level)
            else:
                behind.append(number - int(np.argmin(np.abs(np.array(levels) - level))))
    return max(behind)


if __name__ == "__main__":
    rows()
