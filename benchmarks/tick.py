"""Cost of a whole tick beside a bare PyBullet tick, and the highest rate held.

    python -m benchmarks.tick [--profile]

With ``--profile`` it prints what each part of a tick takes.
A bare tick sets four motors, steps the engine and reads four joints, with the engine settings that
the crane needs. A whole tick reads axes, applies the scheme, moves the crane, judges the aiming
task, writes the frame through to the journal, and with LSL sends it to three outlets that a process
of their own listens to. LSL's threads take time, too. Therefore such a tick is compared with a bare
one whose numbers pylsl sends to another such process. The engines' cranes are measured apart: a
step of each, beside a step of PyBullet's. Rounds alternate, so that a wandering machine moves all
figures together.
"""

import gc
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.bare_engine import PASSES, BareEngine
from benchmarks.table import Row
from labcrane import Dynamics, Frame, InputDevice, Signal, Tick
from labcrane.core.clock import Clock, ManualClock, SystemClock, ticks
from labcrane.design.plan import plan_session
from labcrane.protocol.rig import Rig
from labcrane.protocol.study import Study, load
from labcrane.recording.frame_log import FrameLog, columns
from labcrane.recording.journal import SessionJournal
from labcrane.registry.registry import discover
from labcrane.session import loop
from labcrane.session.commands import Command, Order
from labcrane.session.sequencer import Sequencer
from labcrane.streams.network import use_loopback
from labcrane.testing import ch8, make_run

ROUNDS = 7
TICKS = 2400
WARM_UP = 200
RATES_HZ = (*(round(240 * 1.2**step) for step in range(12)), 2000)
"""A session's rate, and on in steps of a fifth up to the highest that a protocol may ask for."""

PACED_S = 3.0
FEW = 0.01
"""Share of late ticks up to which a rate is held."""

LIMITS = {"whole": ("bare", 2.4, 3.9), "whole, LSL": ("bare, LSL", 2.0, 2.6)}
"""The bare tick that is compared, and how much longer a whole one may take: median and 99 %.

1.3 times the slower computer's. There, whatever runs beside takes the processor's caches within
60 us: the engine's solver, which stays in them by itself, takes 38 us, and each other part of a
tick takes three to four times what it takes alone (``--profile``)."""

SLOWEST = 1.75
"""How much lower the highest rate held may be than that of a loop that does nothing."""

ENGINE_LIMIT = 0.7
"""How long a step of MuJoCo's crane may take beside one of PyBullet's, in the median."""

STUDY = """\
labcrane: 1
study: tick
title: A trial that does not end
rate_hz: {rate}
machine: ch8
input: {{use: dual_joystick}}
scheme:
  use: joint_velocity
  map: {{slew: -left.x, elbow: left.y, wrist: -right.x, shoulder: -right.y}}
dynamics: {{use: bullet_crane}}
tasks:
  aiming: {{use: aiming, end: trigger, limit_s: 1.0e+6}}
sessions:
  - name: only
    steps:
      - block: {{task: aiming}}
"""


class Waves(InputDevice):
    """Sticks that are always on the move."""

    signals = (Signal("left", "1", ("x", "y")), Signal("right", "1", ("x", "y", "trigger")))

    def __init__(self, rate_hz: float) -> None:
        phase = np.arange(int(rate_hz) * 4)[:, None] / rate_hz
        self._axes = 0.5 * np.sin(2 * np.pi * phase * np.array([0.25, 0.5, 0.75, 1.0, 0.0]))

    def read(self, tick: Tick, seen: Frame) -> np.ndarray:
        del seen
        return self._axes[tick.number % len(self._axes)]


class UntilTick:
    """Ends the session after so many ticks."""

    def __init__(self, count: int) -> None:
        self._left = count

    def commands(self) -> list[Command]:
        self._left -= 1
        return [Command(Order.END)] if self._left == 0 else []

    def report(self, event: object) -> None:
        """Nobody looks on."""


def study_at(rate_hz: float, folder: Path) -> Study:
    """Return a study whose first trial outlasts every measurement."""
    path = folder / "study.yaml"
    path.write_text(STUDY.format(rate=rate_hz))
    return load(path, discover())


def whole(
    study: Study,
    folder: Path,
    clock: Clock,
    count: int,
    *,
    lsl: bool,
    parts: dict[str, float] | None = None,
) -> list[Frame]:
    """Run ``count`` whole ticks; return their frames, and the end of each in ``frame.elapsed``.

    ``parts`` gets the seconds that each part of the ticks takes, if it is given.
    """
    plan = plan_session(study, "P001", 1)
    rig = Rig.build(study, simulated=True)
    rig = replace(rig, input=Waves(study.protocol.rate_hz))
    seen: list[Frame] = []

    def end_of_tick(frame: Frame) -> None:
        frame.elapsed = time.perf_counter()
        seen.append(frame)

    with rig.opened(study, plan.seed) as run:
        sequencer = Sequencer(study, plan, rig, waits=False)
        path = folder / f"{time.perf_counter_ns()}.xdf"
        with SessionJournal(path, columns(run), run.rate_hz) as journal, outlets(run, lsl) as push:
            log = FrameLog(journal, run)
            sinks = (*push, end_of_tick)
            if parts is not None:
                for part, owner, method in parts_of(rig, sequencer, log):
                    setattr(owner, method, timed(parts, part, getattr(owner, method)))
                sinks = (*(timed(parts, "show", each) for each in push), end_of_tick)
            loop.run(rig, run, sequencer, clock, UntilTick(count), log, sinks)
        path.unlink()
    return seen


def parts_of(rig: Rig, sequencer: Sequencer, log: FrameLog) -> list[tuple[str, object, str]]:
    """Return the parts of a tick in their order, with the methods that :mod:`~.loop` calls."""
    return [
        ("read", rig.input, "read"),
        ("handle orders", sequencer, "keep_time"),
        ("handle orders", sequencer, "handle"),
        ("control", rig.controller, "command"),
        ("control", rig.controller, "idle"),
        ("step", rig.dynamics, "state"),
        ("step", rig.dynamics, "step"),
        ("judge", sequencer, "evaluate"),
        ("write", log, "write"),
    ]


def timed(
    parts: dict[str, float], part: str, method: Callable[..., object]
) -> Callable[..., object]:
    """Return a method that adds its seconds to a part."""
    parts.setdefault(part, 0.0)

    def call(*values: object) -> object:
        began = time.perf_counter()
        result = method(*values)
        parts[part] += time.perf_counter() - began
        return result

    return call


def profile(count: int = TICKS) -> str:
    """Return what each part of a tick takes, in us, beside the engine alone.

    Timers take 0.1 us a call, which counts for the rest.
    """
    use_loopback()
    parts: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as name:
        study = study_at(240.0, Path(name))
        clock = ManualClock(time.perf_counter())
        with BareEngine(study.machine, study.protocol.rate_hz, PASSES) as engine:
            bare = float(np.mean(bare_times(engine, count)))
        frames = whole(study, Path(name), clock, count, lsl=True, parts=parts)
    all_ = (frames[-1].elapsed - frames[0].elapsed) * count / (count - 1)
    found = {**parts, "the rest": all_ - sum(parts.values()), "whole tick": all_}
    lines = [f"{part:16}{1e6 * seconds / count:8.1f} us" for part, seconds in found.items()]
    return "\n".join([*lines, f"{'bare PyBullet':16}{1e6 * bare:8.1f} us"])


@contextmanager
def outlets(run: object, lsl: bool) -> Iterator[Sequence[Callable[[Frame], None]]]:  # noqa: FBT001
    """Open the session's outlets, with a process that listens to all of them."""
    if not lsl:
        yield ()
        return
    from labcrane.streams.outlets import Outlets  # noqa: PLC0415

    source = f"tick/{time.perf_counter_ns()}"
    sending = Outlets(run, source)
    try:
        with listening(source):
            yield (sending.push,)
    finally:
        sending.close()


@contextmanager
def listening(source: str) -> Iterator[None]:
    """Let a process listen to the outlets of a source."""
    words = [sys.executable, "-c", LISTENER, source]
    listener = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        assert listener.stdout is not None
        assert listener.stdout.readline() == "ready\n"
        yield
    finally:
        listener.kill()
        listener.communicate()


LISTENER = """
import sys, pylsl
names = ("state", "input", "markers")
found = [pylsl.resolve_byprop("source_id", f"labcrane/{sys.argv[1]}/labcrane.{n}", 1, 20.0)[0]
         for n in names]
inlets = [pylsl.StreamInlet(info) for info in found]
for inlet in inlets:
    inlet.open_stream(10.0)
print("ready", flush=True)
while True:
    for inlet in inlets:
        inlet.pull_chunk(0.02)
"""


def bare_times(engine: BareEngine, count: int, send: Callable[[], None] = int) -> np.ndarray:
    """Return the seconds that each of ``count`` ticks of the engine alone took."""
    ends = []
    for _ in range(count):
        engine.tick()
        send()
        ends.append(time.perf_counter())
    return np.diff(ends)


def bare_lsl_times(engine: BareEngine, count: int, sizes: Mapping[str, int]) -> np.ndarray:
    """Return the same of ticks whose numbers pylsl sends, by the sizes of the session's outlets."""
    import pylsl  # noqa: PLC0415 - after the network is loopback's

    source = f"bare/{time.perf_counter_ns()}"
    streams = {
        name: pylsl.StreamOutlet(
            pylsl.StreamInfo(
                f"bare.{name}", "Bare", size, 0.0, "double64", f"labcrane/{source}/labcrane.{name}"
            )
        )
        for name, size in sizes.items()
    }
    numbers = {name: np.zeros(size) for name, size in sizes.items()}

    def send() -> None:
        for name in ("state", "input"):
            streams[name].push_sample(numbers[name])

    with listening(source):
        return bare_times(engine, count, send)


def rows(*, brief: bool = False) -> list[Row]:
    """Return the cost of whole ticks and steps of engines, and the highest rate held."""
    use_loopback()
    rounds, count, rates_hz = (1, 2 * WARM_UP, RATES_HZ[:1]) if brief else (ROUNDS, TICKS, RATES_HZ)
    with tempfile.TemporaryDirectory() as name:
        found = [*costs(cost(Path(name), rounds, count)), engine_row(engine_times(rounds, count))]
        return [*found, rate_row(rates(Path(name), rates_hz=rates_hz))]


def costs(found: Mapping[str, Sequence[np.ndarray]]) -> list[Row]:
    """Return what whole ticks cost beside bare ones, from the times of all rounds."""
    made = []
    for kind, (beside, *limits) in LIMITS.items():
        for (word, share), limit in zip((("median", 0.5), ("99 %", 0.99)), limits, strict=True):
            ours, bare = (
                1e6 * float(np.median([np.quantile(one, share) for one in found[which]]))
                for which in (kind, beside)
            )
            what = beside.replace("bare", "bare PyBullet tick")
            made.append(Row("tick", f"{kind}, {word}, us", ours, bare, what, limit))
    return made


ENGINES = ("bullet_crane", "mujoco_crane")


def engine_times(rounds: int = ROUNDS, count: int = TICKS) -> dict[str, float]:
    """Return the median of a step of either engine's crane, in s, over alternating rounds."""
    machine = ch8()
    run = make_run(machine)
    seconds = np.arange(count) / run.rate_hz
    hertz = np.linspace(0.1, 0.4, len(machine.joints))
    # From rest, and gently: no motor is asked for more than it has.
    waves = 0.4 * np.sin(2 * np.pi * np.outer(seconds, hertz)) * np.array(machine.speeds)
    waves *= np.minimum(1.0, seconds / 0.5)[:, None]
    found: dict[str, list[float]] = {name: [] for name in ENGINES}
    offers = discover().offers[Dynamics]
    for _ in range(rounds):
        for name, medians in found.items():
            offer = offers[name]
            crane = offer.build(offer.settings(), machine)
            crane.open(run)
            gc.collect()
            ends = []
            for command in waves:
                crane.step(command, 1.0 / run.rate_hz)
                ends.append(time.perf_counter())
            crane.close()
            medians.append(float(np.median(np.diff(ends)[WARM_UP:])))
    return {name: float(np.median(medians)) for name, medians in found.items()}


def engine_row(found: Mapping[str, float]) -> Row:
    """Return what a step of MuJoCo's crane takes beside one of PyBullet's."""
    bullet, mujoco = (1e6 * found[name] for name in ENGINES)
    return Row("tick", "mujoco_crane, median us", mujoco, bullet, "bullet_crane", ENGINE_LIMIT)


SIZES = {"state": 22, "input": 5, "markers": 1}
"""Numbers in a sample of each outlet of the study."""

KINDS = (("whole", False), ("whole, LSL", True))
"""Whole ticks, and whether LSL sends them."""


def cost(
    folder: Path,
    rounds: int = ROUNDS,
    count: int = TICKS,
    kinds: Sequence[tuple[str, bool]] = KINDS,
) -> dict[str, list[np.ndarray]]:
    """Print the cost of a tick, bare and whole; return all times in s."""
    study = study_at(240.0, folder)
    found: dict[str, list[np.ndarray]] = {"bare": [], **{kind: [] for kind, _ in kinds}}
    if any(lsl for _, lsl in kinds):
        found["bare, LSL"] = []
    with BareEngine(study.machine, study.protocol.rate_hz, PASSES) as engine:
        for _ in range(rounds):
            gc.collect()
            found["bare"].append(bare_times(engine, count)[WARM_UP:])
            for name, lsl in kinds:
                clock = ManualClock(time.perf_counter())  # LSL takes only times of the computer
                ends = [frame.elapsed for frame in whole(study, folder, clock, count, lsl=lsl)]
                found[name].append(np.diff(ends)[WARM_UP:])
                if lsl:
                    found["bare, LSL"].append(bare_lsl_times(engine, count, SIZES)[WARM_UP:])
    print(f"cost of a tick, {rounds} rounds of {count} ticks, unpaced")
    print(f"{'':12} {'p50 us':>8} {'p99 us':>8} {'ratio p50':>18} {'ratio p99':>18}")
    bare_p50, bare_p99 = (np.array([np.quantile(r, q) for r in found["bare"]]) for q in (0.5, 0.99))
    for name, each in found.items():
        p50, p99 = (np.array([np.quantile(r, q) for r in each]) for q in (0.5, 0.99))
        print(
            f"{name:12} {np.median(p50) * 1e6:8.1f} {np.median(p99) * 1e6:8.1f} "
            f"{spread(p50 / bare_p50):>18} {spread(p99 / bare_p99):>18}"
        )
    return found


def spread(ratios: np.ndarray) -> str:
    """Return median and range."""
    return f"{np.median(ratios):.2f} [{ratios.min():.2f}..{ratios.max():.2f}]"


def late(dues: Sequence[float], wakes: Sequence[float], rate_hz: float) -> float:
    """Return the fraction of ticks that woke over one period after they were due."""
    return float(np.mean(np.subtract(wakes, dues) > 1.0 / rate_hz))


def lateness(kind: str, rate: int, folder: Path) -> float:
    """Return the share of late ticks of the empty or of the whole loop, paced at ``rate`` Hz."""
    count = round(PACED_S * rate)
    if kind == "empty":
        seen = [tick for tick, _ in zip(ticks(SystemClock(), rate), range(count), strict=False)]
    else:
        frames = whole(study_at(rate, folder), folder, SystemClock(), count, lsl=True)
        seen = [frame.tick for frame in frames]
    return late([tick.due for tick in seen], [tick.woke for tick in seen], rate)


def rates(
    folder: Path,
    measure: Callable[[str, int, Path], float] = lateness,
    rates_hz: Sequence[int] = RATES_HZ,
) -> dict[str, float]:
    """Print late ticks at rising rates; return in Hz what each loop holds before it falls behind.

    A rate above one that is not held does not count; nan is a loop that does not hold the lowest.
    """
    print(f"\nlate ticks over {PACED_S:g} s (woke over one period after due), LSL with a consumer")
    print(f"{'rate Hz':>8} {'empty loop':>12} {'whole loop':>12}")
    held = dict.fromkeys(("empty", "whole"), math.nan)
    climbing = list(held)
    for rate in rates_hz:
        shares = {kind: measure(kind, rate, folder) for kind in climbing}
        cells = (f"{shares[kind]:.2%}" if kind in shares else "-" for kind in held)
        print(" ".join([f"{rate:8}", *(f"{cell:>12}" for cell in cells)]))
        climbing = [kind for kind, share in shares.items() if share < FEW]
        held.update(dict.fromkeys(climbing, float(rate)))
        if not climbing:
            break
    print(f"held with under 1 % late: empty loop {held['empty']} Hz, whole {held['whole']} Hz")
    return held


def rate_row(held: Mapping[str, float]) -> Row:
    """Return the shortest tick of a whole loop beside that of an empty one."""
    ours, bare = (1e3 / held[kind] for kind in ("whole", "empty"))
    what = "shortest tick that is held, LSL, ms"
    return Row("tick", what, ours, bare, "of an empty loop", SLOWEST)


if __name__ == "__main__":
    if sys.argv[1:] == ["--profile"]:
        sys.exit(print(profile()))
    use_loopback()
    with tempfile.TemporaryDirectory() as name:
        cost(Path(name))
        rates(Path(name))
