"""Marks random moments on the computer's own clock, with the truth in the marker."""

import json
import random
import time

import pylsl

info = pylsl.StreamInfo("Moments", "Markers", 1, 0, "string", "moments-program")
outlet = pylsl.StreamOutlet(info)
moments = random.Random(7)
while True:
    time.sleep(moments.uniform(0.15, 0.45))
    now = time.perf_counter()
    outlet.push_sample([json.dumps({"truth": now})], now)
