"""A plain stream, a number that counts and channels of noise, stamped when it is sent.

Arguments: name, type, source id, rate in Hz (below 0: sends nothing), number to count from; and if
they are not 2 and float32, number of channels and format.
"""

import random
import sys
import time

import pylsl

name, kind, source_id, rate, first, number, form = (*sys.argv[1:], "2", "float32")[:7]
rate = float(rate)
info = pylsl.StreamInfo(name, kind, int(number), abs(rate), form, source_id)
channels = info.desc().append_child("channels")
electrodes = [(f"E{k}", "microvolts") for k in range(1, int(number))]
for label, unit in (("Counter", "1"), *electrodes):
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", unit)
outlet = pylsl.StreamOutlet(info)
count = int(first)
while True:
    time.sleep(1.0 / abs(rate))
    if rate > 0:
        outlet.push_sample([count, *(random.random() for _ in electrodes)], pylsl.local_clock())
        count += 1
