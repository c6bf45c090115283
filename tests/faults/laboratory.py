"""A laboratory's devices in one process: 64 channels of EEG, gaze, and markers.

Arguments: a word that makes the source ids unique, and seconds. Prints how many samples each sent.
"""

import json
import sys
import time

import numpy as np
import pylsl

word, seconds = sys.argv[1], float(sys.argv[2])
CHUNK_S = 0.02


def outlet(name: str, kind: str, channels: int, rate: float, form: str) -> pylsl.StreamOutlet:
    info = pylsl.StreamInfo(name, kind, channels, rate, form, f"{word}-{name}")
    described = info.desc().append_child("channels")
    for number in range(channels):
        channel = described.append_child("channel")
        channel.append_child_value("label", "Counter" if number == 0 else f"C{number}")
    return pylsl.StreamOutlet(info)


streams = {"EEG": (64, 1000.0), "Gaze": (8, 200.0)}
outlets = {name: outlet(name, name, *form, "float32") for name, form in streams.items()}
markers = outlet("Markers", "Markers", 1, 0.0, "string")
noise = np.random.default_rng(1).normal(size=(1000, 64)).astype(np.float32)
sent = dict.fromkeys([*streams, "Markers"], 0)
sys.stdout.write("ready\n")
sys.stdout.flush()
sys.stdin.readline()  # the recorder is connected: from now on every sample counts
start = pylsl.local_clock()
while (now := pylsl.local_clock() - start) < seconds:
    for name, (channels, rate) in streams.items():
        count = int(now * rate) - sent[name]
        if count > 0:
            chunk = noise[:count, :channels].copy()
            chunk[:, 0] = np.arange(sent[name], sent[name] + count)
            stamps = start + np.arange(sent[name], sent[name] + count) / rate
            outlets[name].push_chunk(chunk, stamps.tolist())
            sent[name] += count
    if int(now * 3) > sent["Markers"]:
        markers.push_sample([f"marker {sent['Markers']}"], pylsl.local_clock())
        sent["Markers"] += 1
    time.sleep(CHUNK_S)
sys.stdout.write(json.dumps(sent) + "\n")
sys.stdout.flush()
sys.stdin.readline()  # outlets stay until everything has been fetched
