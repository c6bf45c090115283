"""Lateness of the loop with the load of a whole laboratory, with and without ``--real-time``.

    python -m benchmarks.real_time [SECONDS]

The load: the pages, two software views, a sound by a JACK server, a film of generated pictures that
are compressed here, the recording of 64 channels at 1 kHz, and an estimate of two of them. The
reference is an empty loop that ticked alone before. The performance targets apply to
``--real-time``; lines above the table give the lateness without it. Needs jackd and real-time
priorities. Nothing leaves this computer.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.beside import QUARTER_MS, RATE_HZ, TESTS, late_ms
from benchmarks.table import Row, dumped, loaded, show
from labcrane import open_recording
from labcrane.core.clock import SystemClock
from labcrane.doctor.scheduling import lateness
from labcrane.streams.network import LOOPBACK

SECONDS, ALONE_S = 30.0, 30.0
FEW = 3.0
"""How many times more late ticks than the empty loop's are allowed, with one added to each: the
host of a virtual computer takes its cores from it now and then, for longer than a tick."""

PERIOD_MS = 1e3 / RATE_HZ
QUANTILES = {"50 %": 0.5, "99 %": 0.99, "99.9 %": 0.999, "all": 1.0}
PROMISED = ("99 %", "99.9 %")

BESIDE = """\
feedback:
  tone: {{use: sonification, driver: jack, block: 1024}}
views:
  operator: {{use: view, display: hidden, renderer: software, size: [640, 360], rate_hz: 30}}
  examiner: {{use: view, display: hidden, renderer: software, size: [640, 360], rate_hz: 30}}
estimates:
  load: {{use: band_power, stream: eeg, channels: [C1], per_channels: [C2], fallback: {{ratio: 1}}}}
recordings:
  cab:
    {{use: camera, format: lavfi, device: "testsrc2=size=640x360:rate=30,realtime", consent: none}}
"""


def rows(*, brief: bool = False) -> list[Row]:
    """Return all figures, from a separate process with its own network settings of liblsl."""
    seconds = 5.0 if brief else SECONDS
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.real_time", "--json", str(seconds)],
        check=True, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    return loaded(done.stdout.splitlines()[-1])


def measure(folder: Path, seconds: float) -> list[Row]:
    """Measure here: an empty loop, a session without, and one with."""
    from jack_server import a_jack_server  # noqa: PLC0415 - needs the path

    alone = 1e3 * lateness(SystemClock(), RATE_HZ, ALONE_S)
    late = {}
    with a_jack_server(folder, real_time=True) as (server, _):
        os.environ["JACK_DEFAULT_SERVER"] = server
        for name, words in (("P001", ()), ("P002", ("--real-time",))):
            late[name] = session(folder, name, seconds, words)
    for name, what in (("P001", "without"), ("P002", "with")):
        told = ", ".join(
            f"{key} {np.quantile(late[name], at):.3f}" for key, at in QUANTILES.items()
        )
        missed = int(np.sum(late[name] > PERIOD_MS))
        print(f"{what} --real-time: late by at most {told} ms; {missed} of {len(late[name])} late")
    quantiles = {key: QUANTILES[key] for key in PROMISED}
    return [
        *(
            Row(
                "real time", f"{key} of ticks late by at most, a laboratory beside, ms",
                float(np.quantile(late["P002"], at)),
                float(np.quantile(alone, at)) + QUARTER_MS, "an empty loop, and a quarter tick",
                1.0,
            )
            for key, at in quantiles.items()
        ),
        Row(
            "real time", "ticks late by a period or more, a laboratory beside, and one",
            1.0 + float(np.sum(late["P002"] > PERIOD_MS)),
            1.0 + float(np.mean(alone > PERIOD_MS)) * len(late["P002"]),
            "of an empty loop, and one", FEW,
        ),
    ]  # fmt: skip


def session(folder: Path, name: str, seconds: float, words: tuple[str, ...]) -> np.ndarray:
    """Run a session with the whole load; return how late its ticks were, in ms."""
    from faults.sessions import labcrane, unique  # noqa: PLC0415 - needs the path
    from faults.test_load import NEEDS, a_study  # noqa: PLC0415

    word = unique("real-time")
    devices = subprocess.Popen(
        [sys.executable, str(TESTS / "faults" / "laboratory.py"), word, str(3 * seconds + 120)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert devices.stdin is not None
        assert devices.stdout is not None
        devices.stdout.readline()
        devices.stdin.write("go\n")
        devices.stdin.flush()
        study = a_study(folder / f"{name}.yaml", seconds, (NEEDS + BESIDE).format(word=word))
        shown = ["--simulate", "--page", "--feedback", "--data", folder / "data", *words]
        run = labcrane("run", study, "--participant", name, *shown)
        said, _ = run.communicate()
        assert run.returncode == 0, said
    finally:
        devices.kill()
        devices.communicate()
    kept = folder / "data" / f"{name}-SIMULATED"
    assert list(kept.rglob("*.mkv")), "nothing was filmed"
    estimated = open_recording(kept / f"{name}-SIMULATED.h5").session(1).streams["input"].data
    assert (estimated["estimate.load.state"] == 0.0).any(), "nothing was estimated"
    _, late = late_ms(kept / f"{name}-SIMULATED.h5")
    return late


def main() -> None:
    """Measure everything, and print it for people or for the calling process."""
    sys.path[:0] = [str(TESTS), str(TESTS / "helpers")]
    numbers = [float(word) for word in sys.argv[1:] if word != "--json"]
    with tempfile.TemporaryDirectory(prefix="labcrane-real-time-") as name:
        folder = Path(name)
        config = folder / "lsl_api.cfg"
        config.write_text(LOOPBACK.replace("[lab]", f"[lab]\nSessionID = rt-{os.getpid()}"))
        os.environ["LSLAPICFG"] = str(config)
        found = measure(folder, *(numbers or [SECONDS]))
    show(found)
    if "--json" in sys.argv:
        print(dumped(found))


if __name__ == "__main__":
    main()
