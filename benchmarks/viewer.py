"""Viewer: opening an hour at 240 Hz with 64 EEG channels, jumping in it, and memory.

    python -m benchmarks.viewer [--minutes 60]

A recorded session is repeated until it is an hour long, and EEG is added; `labcrane view` shows it
in headless Chromium. A jump lasts from the command in the browser until the frame after the one in
which the machine was painted in its recorded pose. Without a graphics card, the processor draws.
Needs Chromium.
"""

import argparse
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import psutil

from benchmarks.table import Row, show

if TYPE_CHECKING:
    from labcrane.web.viewer.film import Film

TESTS = Path(__file__).parents[1] / "tests"
CHANNELS, EEG_HZ = 64, 500.0
JUMPS = 40
OPEN_S, JUMP_S, FLAT = 10.0, 0.2, 1.1

LAST = "return Boolean(document.getElementById('range-0')?.innerText)"
"""Whether everything is there: the first curve comes last."""

JUMP = """
const [at, wanted, done] = arguments;
const scene = window['scene_' + document.querySelector('.nicegui-scene').id];
const bodies = {};
scene.traverse(o => { if (o.name.startsWith('body ')) bodies[o.name.slice(5)] = o; });
const there = () => Object.entries(wanted).every(([name, pose]) => {
    bodies[name].updateWorldMatrix(true, false);
    return pose.every((value, n) => Math.abs(bodies[name].matrixWorld.elements[n] - value) < 1e-6);
});
const began = performance.now();
// Callbacks come before a frame is painted: in the one after it, the machine has been.
const painted = () => requestAnimationFrame(() => requestAnimationFrame(
    () => done(performance.now() - began)));
const look = () => there() ? painted() : setTimeout(look, 2);
const field = document.getElementById('second');
field.value = at;
field.dispatchEvent(new Event('change'));
look();
"""


PAINT = """
const [done] = arguments, began = performance.now();
requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now() - began)));
"""
"""The two pictures that a jump waits for, without a jump: slow where no graphics card draws."""

MINUTES = 60.0


def rows(*, brief: bool = False) -> list[Row]:
    """Return how soon an hour opens and jumps, and how much the memory grows."""
    return rows_of(0.5 if brief else MINUTES)


def rows_of(minutes: float) -> list[Row]:
    """Return the same of a session so long."""
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]
    from pages.room import a_browser  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = recorded(folder, minutes)
        with a_browser(folder / "profile") as browser:
            whole = looked(file, browser)
    size = f"{minutes:g} min at 240 Hz, {CHANNELS} channels of EEG"
    return [
        Row("viewer", f"{size}: open, s", whole.opened, OPEN_S, "promised", 1.0),
        Row("viewer", f"{size}: a jump, s of the processor", whole.used, JUMP_S, "promised", 1.0),
        Row(
            "viewer",
            f"{size}: 19 of 20 jumps, painted, s",
            whole.jump,
            JUMP_S + whole.paint,
            "promised, and the browser's own two pictures",
            1.0,
        ),
        Row("viewer", f"{size}: MB after {JUMPS} jumps", whole.after, whole.before, "before", FLAT),
    ]


@dataclass(frozen=True)
class Looked:
    """Seconds until it is open, of jumps, and of the browser's own pictures; MB before and after.

    Of jumps and pictures, 19 of 20 took no longer; ``used`` is the processor's time for a jump.
    """

    opened: float
    jump: float
    paint: float
    used: float
    before: float
    after: float


def recorded(folder: Path, minutes: float) -> Path:
    """Return the participant file of a session so long, with EEG beside it."""
    import h5py  # noqa: PLC0415 - loads for a moment
    from pages.test_viewer import STUDY  # noqa: PLC0415

    from labcrane.recording.participant_file.columns import (  # noqa: PLC0415
        write_attributes,
        write_numbers,
    )

    protocol = folder / "study.yaml"
    protocol.write_text(STUDY.format(study="viewed"))
    words = [str(protocol), "--participant", "P001", "--simulate", "--fast"]
    command = [sys.executable, "-m", "labcrane", "run", *words, "--data", str(folder / "data")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    file = folder / "data" / "P001-SIMULATED" / "P001-SIMULATED.h5"
    with h5py.File(file, "r+") as opened:
        session = opened["ses-01"]
        time_s = session["time"][:]
        count, period = len(time_s), time_s[-1] - time_s[0] + 1.0 / 240.0
        times = int(np.ceil(60.0 * minutes / period))
        shifts = period * np.arange(times)
        events = len(session["events/time"])
        for path, node in each(session):
            values = node[:]
            if (len(values) == count and values.dtype.kind == "f") or (
                path.startswith("events/") and len(values) == events
            ):
                repeated = np.tile(values, times)
            else:
                continue
            if path.endswith(("time", "due", "woke")):
                repeated = repeated + np.repeat(shifts, len(values))
            about = dict(node.attrs)
            del session[path]
            dataset = session.create_dataset(
                path, data=repeated, chunks=(min(len(repeated), 1 << 16),), compression="gzip",
                compression_opts=1, shuffle=True,
            )  # fmt: skip
            for key, value in about.items():
                dataset.attrs[key] = value
        eeg = np.arange(0.0, times * period, 1.0 / EEG_HZ) + time_s[0]
        stream = session.create_group("streams/EEG")
        write_attributes(stream, {"name": "EEG", "type": "EEG"})
        write_numbers(stream, "time_raw", eeg, "s")
        write_numbers(stream, "time", eeg, "s")
        data, dice = stream.create_group("data"), np.random.default_rng(0)
        for number in range(CHANNELS):
            noise = np.round(20.0 * dice.standard_normal(len(eeg)), 1)
            write_numbers(data, f"ch{number}", noise, "uV")
            write_attributes(data[f"ch{number}"], {"position": number, "name": f"ch{number}"})
    return file


def each(group):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN201 - h5py has no types
    """Return every column below a group, with its path."""
    import h5py  # noqa: PLC0415

    found = []
    group.visititems(
        lambda path, node: (
            found.append((path, node))
            if isinstance(node, h5py.Dataset) and len(node.shape) == 1
            else None
        )
    )
    return found


def looked(file: Path, browser: object) -> Looked:
    """Look at a recording in a browser."""
    from pages.test_viewer import reached  # noqa: PLC0415

    from labcrane import open_recording  # noqa: PLC0415
    from labcrane.web.viewer.film import KEPT, Film  # noqa: PLC0415

    film = Film(open_recording(file).session(1), "P001")
    began = time.perf_counter()
    words = [sys.executable, "-m", "labcrane", "view", str(file)]
    viewer = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        link = next(line for line in viewer.stdout if line.startswith("viewer: ")).split()[1]
        while not reached(browser, link):
            time.sleep(0.05)
        while not browser.execute_script(LAST):
            time.sleep(0.01)
        opened = time.perf_counter() - began
        browser.set_script_timeout(120)
        for channel in range(KEPT + 1):  # fills the cache: each further read replaces one
            curves(browser, channel)
        draw, process = random.Random(23), psutil.Process(viewer.pid)
        jump(browser, film, 0.0)
        before, began_s = process.memory_info().rss / 1e6, sum(process.cpu_times()[:2])
        took = [jump(browser, film, draw.uniform(0.0, film.length)) for _ in range(JUMPS)]
        used = (sum(process.cpu_times()[:2]) - began_s) / JUMPS
        paint = [float(browser.execute_async_script(PAINT)) / 1000.0 for _ in range(JUMPS)]
        for channel in range(KEPT + 1, 3 * KEPT):
            curves(browser, channel)
        after = process.memory_info().rss / 1e6
    finally:
        viewer.terminate()
        viewer.wait(60)
        viewer.stdout.close()
    jumped, painted = (float(np.quantile(each, 0.95)) for each in (took, paint))
    return Looked(opened, jumped, painted, used, before, after)


def jump(browser: object, film: "Film", at: float) -> float:
    """Go to a second; return how long it took until the machine was painted as it stood then."""
    from labcrane.machines.kinematics import link_frames  # noqa: PLC0415

    frame = film.frame(at)
    angles = np.array([frame[f"state.joint.angle.{name}"] for name in film.machine.names])
    frames = link_frames(film.machine, angles)
    wanted = {body.name: frames[body.frame].T.ravel().tolist() for body in film.run.bodies}
    return float(browser.execute_async_script(JUMP, at, wanted)) / 1000.0


CURVE = """
const [label, done] = arguments, select = document.getElementById('signal-1');
const drawn = () => document.querySelectorAll('.view-chart')[1].querySelector('path')
                            ?.getAttribute('d');
const before = drawn();
const option = [...select.options].find(o => o.textContent.includes(label));
select.value = option.value;
select.dispatchEvent(new Event('change'));
const look = () => drawn() && drawn() !== before ? done(true) : setTimeout(look, 10);
look();
"""


def curves(browser: object, channel: int) -> None:
    """Look at the whole hour of one channel."""
    browser.execute_async_script(CURVE, f"EEG ch{channel},")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    show(rows_of(parser.parse_args().minutes))
