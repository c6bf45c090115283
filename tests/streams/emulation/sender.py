"""A plain stream of two channels, a number that counts and noise, stamped when it is sent.

Arguments: name, type, source id, rate in Hz (below 0: sends nothing), number to count from.
"""

import random
import sys
import time

import pylsl

name, kind, source_id, rate, first = sys.argv[1:]
rate = float(rate)
info = pylsl.StreamInfo(name, kind, 2, abs(rate), "float32", source_id)
channels = info.desc().append_child("channels")
for label, unit in (("Counter", "1"), ("E1", "microvolts")):
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", unit)
outlet = pylsl.StreamOutlet(info)
count = int(first)
while True:
    time.sleep(1.0 / abs(rate))
    if rate > 0:
        outlet.push_sample([count, random.random()], pylsl.local_clock())
        count += 1
