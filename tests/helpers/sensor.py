"""Imitates a photodiode or a microphone: what was logged, so and so much later, as samples.

python sensor.py display|audio NAME_OF_SENSOR NAME_OF_LOG COLUMN_OF_TIME COLUMN_OF_LEVEL DELAY_S
"""

import sys
import time

import numpy as np
import pylsl

RATE = 1000.0
BEHIND_S = 0.1
"""Samples are made so long after their time, when what was logged has come."""

kind, sensor, log, time_column, level_column, delay = sys.argv[1:]
outlet = pylsl.StreamOutlet(pylsl.StreamInfo(sensor, "Sensor", 2, RATE, "float32", sensor))
random = np.random.default_rng(3)
while not (found := pylsl.resolve_byprop("name", log, timeout=1.0)):
    pass
inlet = pylsl.StreamInlet(found[0], processing_flags=0)
labels = inlet.info().get_channel_labels()
at, level = labels.index(time_column) if time_column else None, labels.index(level_column)
inlet.open_stream()
times, levels = [0.0], [0.0]
made = pylsl.local_clock()
while True:
    for row, stamp in zip(*inlet.pull_chunk(timeout=0.0), strict=True):
        times.append((stamp if at is None else row[at]) + float(delay))
        levels.append(row[level])
    until = pylsl.local_clock() - BEHIND_S
    now = np.arange(made, until, 1.0 / RATE)
    if len(now):
        last = np.searchsorted(times, now, side="right") - 1
        if kind == "display":
            seen = 0.2 + 0.5 * np.array(levels)[last]
        else:  # a sound is there for 0.1 s after each time it was logged
            sounds = now - np.array(times)[last] < 0.1
            seen = np.where(sounds, np.sign(np.sin(2 * np.pi * 170 * now)), 0.0)
        seen = seen + random.normal(0.0, 0.01, len(now))
        for value, stamp in zip(seen, now, strict=True):
            outlet.push_sample([0.0, value], stamp)
        made = now[-1] + 1.0 / RATE
    time.sleep(0.01)
