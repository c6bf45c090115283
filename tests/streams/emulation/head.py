"""An amplifier with a person's EEG on it; a line on its input makes the channel it names flat.

Arguments: source id.
"""

import sys
import threading
import time

import numpy as np
import pylsl
import synthetic_signals as synthetic

RATE_HZ = 250.0
rng = np.random.default_rng(12)
head = synthetic.a_head(rng, RATE_HZ, 8)
signal = synthetic.eeg(rng, head, 120.0) * synthetic.UNITS[head.unit]
stream = head.stream
info = pylsl.StreamInfo("Amplifier", "EEG", 8, RATE_HZ, "float32", sys.argv[1])
channels = info.desc().append_child("channels")
for each in stream.channels:
    channel = channels.append_child("channel")
    channel.append_child_value("label", each.label)
    channel.append_child_value("unit", each.unit)
outlet = pylsl.StreamOutlet(info)
flat: dict[int, float] = {}


def listen() -> None:
    for line in sys.stdin:
        what, column = line.split()
        if what == "flat":
            flat[int(column)] = float(signal[0, int(column)])
        else:
            flat.pop(int(column))


threading.Thread(target=listen, daemon=True).start()
began, sent = pylsl.local_clock(), 0
while sent < len(signal):
    time.sleep(0.02)
    due = int((pylsl.local_clock() - began) * RATE_HZ)
    if due > sent:
        chunk = signal[sent:due].astype(np.float32)
        for column, value in dict(flat).items():
            chunk[:, column] = value
        outlet.push_chunk(np.ascontiguousarray(chunk), began + (due - 1) / RATE_HZ)
        sent = due
