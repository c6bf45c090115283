"""Writes down the counts of every sample of a device's streams that reaches it, as it comes.

Argument: the device's source id. Output: a JSON line for each chunk, a stream's name and counts.
"""

import json
import sys
import time

import pylsl

source = sys.argv[1]
inlets = {}
resolver = pylsl.ContinuousResolver(pred=f"starts-with(source_id, '{source}/')")
while len(inlets) < 3:
    for info in resolver.results():
        if info.name() not in inlets:
            inlets[info.name()] = pylsl.StreamInlet(info, max_buflen=360)
            inlets[info.name()].open_stream(240.0)
    time.sleep(0.05)
del resolver
sys.stdout.write("ready\n")
while True:
    for name, inlet in inlets.items():
        samples, stamps = inlet.pull_chunk(0.0, 4096)
        if stamps:
            counts = [int(float(sample[0])) for sample in samples]
            sys.stdout.write(json.dumps([name, counts]) + "\n")
    sys.stdout.flush()
    time.sleep(0.01)
