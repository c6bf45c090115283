"""A device with two streams, sample by sample and in chunks, and a program with markers.

Arguments: source id, rate in Hz. Every stream counts its samples from 0.
"""

import sys
import time

import pylsl

source, rate = sys.argv[1], float(sys.argv[2])
CHUNK = 16


def outlet(name: str, kind: str, channels: int, hz: float, form: str) -> pylsl.StreamOutlet:
    info = pylsl.StreamInfo(name, kind, channels, hz, form, f"{source}/{name}")
    return pylsl.StreamOutlet(info)


single = outlet("Single", "EEG", 2, rate, "float32")
chunked = outlet("Chunked", "EEG", 2, rate, "double64")
markers = outlet("Keys", "Markers", 1, 0.0, "string")
began = pylsl.local_clock()
count = 0
sys.stdout.write("ready\n")
sys.stdout.flush()
waiting = []
while True:
    due = began + count / rate
    if (early := due - pylsl.local_clock()) > 0.0:
        time.sleep(early)
    single.push_sample([count, count % 7], due)
    waiting.append([count, 0.5])
    if len(waiting) == CHUNK:
        chunked.push_chunk(waiting, due)
        waiting.clear()
    if count % 10 == 0:
        markers.push_sample([str(count // 10)], due)
    count += 1
