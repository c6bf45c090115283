"""Imitates an accelerometer on a board's first tactor, so and so much later, as samples.

python accelerometer.py NAME_OF_SENSOR LOG_OF_PINS DELAY_S
"""

import sys
import time
from pathlib import Path

import numpy as np
import pylsl

RATE = 1000.0
BEHIND_S = 0.1
"""Samples are made so long after their time, when the board's log has come."""

sensor, log, delay = sys.argv[1:]
outlet = pylsl.StreamOutlet(pylsl.StreamInfo(sensor, "Sensor", 1, RATE, "float32", sensor))
random = np.random.default_rng(3)
made = pylsl.local_clock()
while True:
    rows = [line.split() for line in Path(log).read_text().splitlines()]
    first = [(float(at) + float(delay), float(level)) for at, pin, level in rows if pin == "3"]
    times, levels = np.transpose([(0.0, 0.0), *first])
    now = np.arange(made, pylsl.local_clock() - BEHIND_S, 1.0 / RATE)
    felt = levels[np.searchsorted(times, now, side="right") - 1] / 255.0
    shaken = felt * np.sign(np.sin(2 * np.pi * 170 * now)) + random.normal(0.0, 0.01, len(now))
    for value, stamp in zip(shaken, now, strict=True):
        outlet.push_sample([9.81 + value], stamp)
        made = stamp + 1.0 / RATE
    time.sleep(0.01)
