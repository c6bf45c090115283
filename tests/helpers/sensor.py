"""Imitates a photodiode or a microphone: what was logged, so and so much later, as samples.

python sensor.py display|audio NAME_OF_SENSOR NAME_OF_LOG OF_TIME OF_LEVEL DELAY_S [BEHIND_S]

Samples are made so long after their time, when what was logged has come: 0.1 s by default.
"""

import sys
import time

import numpy as np
import pylsl

RATE = 1000.0

kind, sensor, log, time_column, level_column, delay, behind = [*sys.argv[1:], "0.1"][:7]
about = pylsl.StreamInfo(sensor, "Sensor", 2, RATE, "float32", sensor)
about.set_channel_labels(["Nothing", kind])
outlet = pylsl.StreamOutlet(about)
random = np.random.default_rng(3)
while not (found := pylsl.resolve_byprop("name", log, timeout=1.0)):
    pass
inlet = pylsl.StreamInlet(found[0], processing_flags=0)
labels = inlet.info().get_channel_labels()
at, level = labels.index(time_column) if time_column else None, labels.index(level_column)
inlet.open_stream()
inlet.time_correction()  # the first takes long
times, levels = [0.0], [0.0]
made = pylsl.local_clock()
while True:
    rows, stamps = inlet.pull_chunk(timeout=0.0)
    for row, stamp in zip(rows, stamps, strict=True):
        late = float(delay) + inlet.time_correction()  # its own clock may be another
        times.append((stamp if at is None else row[at]) + late)
        levels.append(row[level])
    until = pylsl.local_clock() - float(behind)
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
