"""A program that knows nothing of labcrane: prints what it receives from streams, as JSON.

Arguments: a stream's source id and how many samples to wait for, for each stream.
"""

import json
import sys
import time

import pylsl

wanted = [
    (source, int(count)) for source, count in zip(sys.argv[1::2], sys.argv[2::2], strict=True)
]
inlets = {}
for source, _ in wanted:
    found = pylsl.resolve_byprop("source_id", source, 1, 240.0)
    inlets[source] = pylsl.StreamInlet(found[0])
    inlets[source].open_stream(240.0)
sys.stdout.write("ready\n")
sys.stdout.flush()
result = {}
deadline = time.monotonic() + 240.0
for source, count in wanted:
    info = inlets[source].info(240.0)
    samples, stamps = [], []
    while len(stamps) < count and time.monotonic() < deadline:
        values, times = inlets[source].pull_chunk(0.2)
        samples += values
        stamps += times
    result[source] = {"xml": info.as_xml(), "samples": samples, "stamps": stamps}
sys.stdout.write(json.dumps(result) + "\n")
