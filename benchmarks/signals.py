"""Cost of looking at signals, as a share of a core.

    python -m benchmarks.signals

The monitors that are installed look at 64 channels of noise at 1 kHz, in chunks of 20 ms as an
amplifier sends them; the fastest of several rounds counts, because a busy computer only ever makes
a round slower.
"""

import time

import numpy as np

from benchmarks.table import Row, show
from labcrane.core import SignalChannel, SignalStream
from labcrane.monitoring.config import MonitorBuilder, MonitorConfig
from labcrane.monitoring.monitored_stream import MonitoredStream

RATE_HZ, CHANNELS, SECONDS, ROUNDS = 1000, 64, 20, 5
CHUNK = 20
SHARE = 0.006
"""Of a core, at most."""


def cost(
    builder: MonitorBuilder, kind: str, unit: str, seconds: int, channels: int = CHANNELS
) -> float:
    """Return the processor's time for a second of a stream, in seconds."""
    rng = np.random.default_rng(1)
    shared = np.cumsum(rng.standard_normal((RATE_HZ * seconds, 1)), axis=0)
    samples = 0.3 * shared + 5.0 * rng.standard_normal((RATE_HZ * seconds, channels))
    labels = tuple(SignalChannel(f"E{at}", unit) for at in range(channels))
    stream = SignalStream("Amplifier", kind, float(RATE_HZ), labels)
    times = np.arange(len(samples)) / RATE_HZ
    best = float("inf")
    for _ in range(ROUNDS):
        watched = MonitoredStream(stream, builder.build(stream))
        assert watched.watched
        began = time.process_time()
        for at in range(0, len(samples), CHUNK):
            watched.look(times[at : at + CHUNK], samples[at : at + CHUNK])
        best = min(best, (time.process_time() - began) / seconds)
        assert not watched.faults
    return best


def rows(*, brief: bool = False) -> list[Row]:
    """Return what monitors cost beside the time that the signal takes."""
    seconds = 2 if brief else SECONDS
    builder = MonitorBuilder(MonitorConfig())
    eeg, other = (cost(builder, *kind, seconds) for kind in (("EEG", "microvolts"), ("Other", "V")))
    what = f"{CHANNELS} channels at 1 kHz, s of one core per s"
    reference = "the signal's own time"
    return [
        Row("signals", f"EEG, {what}", eeg, 1.0, reference, SHARE),
        Row("signals", f"any, {what}", other, 1.0, reference, SHARE),
    ]


if __name__ == "__main__":
    show(rows())
