"""Synchronisation: how far markers fall from the right samples, with wrong clocks.

    python -m benchmarks.sync [--seconds 240] [--restarts 8] [--draws 3] [--page PAGE]

The first part simulates misbehaving devices and clocks with random parameters and known true times.
It compares the error of each with the uncertainty that the report states. The second part uses
processes: a device with another clock sends the true time of each sample, and a program on this
computer sends markers with their true times. labcrane's recorder records and corrects both. The
reference is pyxdf on the same samples, with clock offsets collected as LabRecorder does. Needs gcc;
takes a little over twice the seconds given; with 0, the table is omitted. Nothing leaves this
computer.
"""

import argparse
import logging
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.table import Row, dumped, loaded, missed
from labcrane.streams.network import LOOPBACK

if TYPE_CHECKING:
    from streams.unkind_score import Score

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]

EXACT, CHUNK = "exact", "chunk"
LEAST_S, MEAN_S = 0.008, 0.012
MISSTAMPED_S = 0.001
COVERED, NAMED = 0.99, 0.95
BEGIN, END = "<!-- python -m benchmarks.sync --page writes this -->", "<!-- as far as here -->"
HEAD = (
    "| device or clock | error, 95 % (worst) | stated, median | covered, least | pyxdf | PASS |",
    "|---|---|---|---|---|---|",
)
SHORT = ("--seconds", "60", "--restarts", "2", "--draws", "2")
INSTANT = ("--seconds", "10", "--restarts", "1", "--draws", "1")


@dataclass(frozen=True)
class Case:
    """A device, and the largest 95th percentile of the error in milliseconds."""

    name: str
    limit_ms: float
    mode: str = EXACT
    wander: float = 0.0
    step: float = 0.0
    reply: float = 0.0


QUIET = (
    Case("100 ppm", 0.02),
    Case("wander 1 ms in 200 s", 0.05, wander=0.001),
    Case("step 0.3 s", 0.05, step=0.3),
    Case("random probe delay", 0.15, reply=0.002),
)
BUSY = (Case("100 ppm, both cores busy", 0.02), Case("chunks, both cores busy", 0.3, mode=CHUNK))


def rows(*, brief: bool = False) -> list[Row]:
    """Return the rows of misbehaving devices, of each case and of restarts; takes three minutes."""
    # In a separate process, because liblsl reads its network settings once, when it is loaded.
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.sync", *(INSTANT if brief else SHORT), "--json"],
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    *said, last = done.stdout.splitlines() or [""]
    print("\n".join(said))
    if not last.startswith("[["):
        raise RuntimeError(f"the benchmark of sync ended without figures: {done.stderr}")
    found = loaded(last)
    if bool(missed(found)) != bool(done.returncode):
        raise RuntimeError(f"the benchmark of sync exits with {done.returncode}: {done.stderr}")
    return found


def main() -> int:
    """Print the table; 0 when all is within its limits, else 1, and what is not is named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=240.0)
    parser.add_argument("--restarts", type=int, default=8)
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--page", type=Path, help="file for the table of misbehaving devices")
    parser.add_argument("--json", action="store_true", help="end with all rows in one line")
    options = parser.parse_args()
    logging.getLogger("pyxdf").setLevel(logging.ERROR)  # it finds the irregular streams odd
    found = misbehaving(options.draws, options.page) if options.draws else []
    with tempfile.TemporaryDirectory(prefix="labcrane-sync-") as name:
        folder = Path(name)
        config = folder / "lsl_api.cfg"
        config.write_text(LOOPBACK.replace("[lab]", f"[lab]\nSessionID = sync-{os.getpid()}"))
        os.environ["LSLAPICFG"] = str(config)
        print(f"{'marker to sample, ms':26}| p50    p95    max    | limit | as LabRecorder + pyxdf")
        if options.seconds:
            found += run(QUIET, folder / "quiet", options.seconds, load=0)
            found += run(BUSY, folder / "busy", options.seconds, load=3)
        if options.restarts:
            found += restarts(folder / "restarts", options.restarts)
    beyond = missed(found)
    print("\n".join(f"MISSED {each}" for each in beyond) or f"all {len(found)} are kept")
    if options.json:
        print(dumped(found))
    return 1 if beyond else 0


def misbehaving(draws: int, page: Path | None) -> list[Row]:
    """Print a line for each misbehaving device; return its rows and write the table to ``page``."""
    from streams.strangers import ALL  # noqa: PLC0415
    from streams.unkind_score import score, shortcomings, table_line  # noqa: PLC0415 - the path

    every, lines = [], [*HEAD]
    print(*HEAD, sep="\n")
    for row in ALL:
        found = [score(row, seed, usual=True) for seed in range(draws)]
        every += found
        broken = sorted({what for one in found for what in shortcomings(one)})
        lines.append(table_line(found))
        print(lines[-1], "; ".join(broken).upper(), flush=True)
    if page is not None:
        before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        table = "\n".join([*lines, "", f"{draws} draws of each. {summary(every)}"])
        page.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{after}", encoding="utf-8")
    return [*promises(every), *of_devices(every)]


def of_devices(every: Sequence["Score"]) -> list[Row]:
    """Return each misbehaving device's error, compared with its limit or stated uncertainty."""
    found = []
    for device in dict.fromkeys(one.row for one in every):
        draws = [one for one in every if one.row == device]
        error = float(np.mean([one.p95 for one in draws]))
        if all(one.clean for one in draws):
            limit, whose = min(one.limit for one in draws), "docs/accuracy.md"
        else:
            limit, whose = float(np.mean([one.stated for one in draws])), "95 % of what is stated"
        found.append(Row("sync", f"{device}, 95 % of errors below, ms", error, limit, whose, 1.0))
    return found


def summary(every: Sequence["Score"]) -> str:
    """Say how much of all draws is within what is stated, and how well faults are named."""
    from streams.unkind_score import coverage, misnamed  # noqa: PLC0415 - needs the path

    least = min((min(each) for each in misnamed(every).values()), default=math.nan)
    return (
        f"Of all samples {100 * coverage(every):.2f} % are within what is stated; the least "
        f"precision or recall of a fault's name is {least:.2f}."
    )


def promises(every: Sequence["Score"]) -> list[Row]:
    """Return the rows of all draws of misbehaving devices together."""
    from streams.unkind_score import (  # noqa: PLC0415 - needs the path
        coverage,
        misnamed,
        shortcomings,
        worse_rows,
    )

    named = misnamed(every)
    for fault, (precision, recall) in named.items():
        if min(precision, recall) < 1.0:
            print(f"  {fault}: precision {precision:.2f}, recall {recall:.2f}")
    print(summary(every))
    broken, worse = sum(bool(shortcomings(one)) for one in every), len(worse_rows(every))
    uncovered = 100.0 * (1.0 - coverage(every))
    # Without a fault, present or reported, the reports of faults cannot be assessed.
    unnamed = 100.0 * (1.0 - min((min(each) for each in named.values()), default=math.nan))
    allowed = [100.0 * (1.0 - share) for share in (COVERED, NAMED)]
    document = "docs/accuracy.md"
    return [
        Row(
            "sync",
            "draws of misbehaving devices that miss a target, and one",
            1.0 + broken,
            1.0,
            "none",
            1.0,
        ),
        Row(
            "sync",
            "misbehaving devices worse than by pyxdf, and one",
            1.0 + worse,
            1.0,
            "none",
            1.0,
        ),
        Row("sync", "samples beyond what is stated, %", uncovered, allowed[0], document, 1.0),
        Row("sync", "worst fault: wrong or left out, %", unnamed, allowed[1], document, 1.0),
    ]


def run(cases: tuple[Case, ...], folder: Path, seconds: float, load: int) -> list[Row]:
    """Record the cases side by side; print and return how far they are off."""
    from streams.emulation import Lab, Skew, build, stop, until  # noqa: PLC0415 - needs the path

    folder.mkdir()
    lab = Lab(folder, build(folder))
    try:
        for case in cases:
            step_after = 10.0 + 0.4 * seconds
            lab.device(
                case.name,
                Skew(
                    wander=case.wander,
                    step=case.step,
                    step_after=step_after,
                    reply=case.reply,
                    mode=case.mode,
                ),
            )
        lab.markers()
        recorder = lab.recorder(
            *({"label": kind, "type": kind, "several": True} for kind in ("EEG", "Markers"))
        )
        count = len(cases) + 1
        until(recorder, lambda status: status["ready"] and len(status["streams"]) == count)
        for _ in range(load):
            lab.load()
        time.sleep(seconds)
        stop(recorder)
        return [row for case in cases for row in judge(case, lab.streams(), folder)]
    finally:
        lab.close()


def judge(case: Case, streams: dict, folder: Path) -> list[Row]:
    """Print a line of the table; return it beside the usual way and beside its limit."""
    from streams.emulation import alignment, as_labrecorder, truth  # noqa: PLC0415

    from labcrane.streams.sync.correction import Treatment, correct  # noqa: PLC0415
    from labcrane.streams.sync.dejitter import Dejitter  # noqa: PLC0415
    from labcrane.streams.sync.raw import raw_of  # noqa: PLC0415
    from labcrane.streams.sync.resync import resync  # noqa: PLC0415

    device, markers = streams[case.name], streams["Moments"]
    treatment = Treatment(rate_hz=1000.0)
    if case.mode == CHUNK:
        treatment = Treatment(1000.0, dejitter=Dejitter.ENVELOPE, transport_s=LEAST_S)
    ours = alignment(
        truth(device), correct(raw_of(device), treatment).time, truth(markers), resync(markers).time
    )
    their_device = as_labrecorder(device, folder / f"{case.name}.xdf")["time_stamps"]
    their_markers = as_labrecorder(markers, folder / f"{case.name} markers.xdf")["time_stamps"]
    known = MEAN_S if case.mode == CHUNK else 0.0
    theirs = alignment(truth(device), their_device - known, truth(markers), their_markers)
    p50, p95, most = 1e3 * np.quantile(np.abs(ours), (0.5, 0.95, 1.0))
    usual = 1e3 * np.quantile(np.abs(theirs), 0.95)
    good = p95 <= case.limit_ms
    print(
        f"{case.name:26}| {p50:.4f} {p95:.4f} {most:.4f} | {case.limit_ms:5} | {usual:.4f}"
        f"{'' if good else '   BEYOND ITS LIMIT'}",
        flush=True,
    )
    what = f"{case.name}, 95 % of errors below, ms"
    return [
        Row("sync", what, float(p95), float(usual), "pyxdf after LabRecorder", 1.0),
        Row("sync", what, float(p95), case.limit_ms, "docs/accuracy.md", 1.0),
    ]


def restarts(folder: Path, count: int) -> list[Row]:
    """Kill a device and start it with another clock, again and again; count wrong stamps."""
    from streams.emulation import Lab, Skew, build, stop, truth, until_ready  # noqa: PLC0415

    from labcrane.streams.sync.resync import resync  # noqa: PLC0415

    folder.mkdir()
    lab = Lab(folder, build(folder))
    try:
        device = lab.device("Restarted", Skew())
        recorder = lab.recorder({"label": "EEG", "name": "Restarted"})
        until_ready(recorder)
        for number in range(count):
            time.sleep(4.0)
            device.kill()
            device.wait()
            device = lab.device("Restarted", Skew(offset=1000.0 + 4000.0 * (-1) ** number))
            until_ready(recorder)
        time.sleep(6.0)
        stop(recorder)
        stream = lab.streams()["Restarted"]
    finally:
        lab.close()
    corrected = resync(stream)
    error = np.abs(corrected.time - truth(stream))
    wrong = int(np.count_nonzero(~(error < MISSTAMPED_S)))
    print(
        f"{count} restarts with another clock: {wrong} of {len(error)} samples are off by more "
        f"than {1e3 * MISSTAMPED_S:g} ms; largest error {1e3 * error.max():.4f} ms, "
        f"{len(corrected.segments)} clocks found"
    )
    return restarted(wrong, len(corrected.segments), count)


def restarted(wrong: int, clocks: int, count: int) -> list[Row]:
    """Return what is promised of ``count`` restarts: no wrong stamp, and each clock found."""
    stamps = "samples off by over 1 ms when a device restarts, and one"
    what = "clocks too many or too few when a device restarts, and one"
    return [
        Row("sync", stamps, 1.0 + wrong, 1.0, "none", 1.0),
        Row("sync", what, 1.0 + abs(clocks - (count + 1)), 1.0, "none", 1.0),
    ]


if __name__ == "__main__":
    sys.exit(main())
