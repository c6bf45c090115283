"""Ten devices of other programs, and a control station, as their authors write them: pylsl alone.

Argument: a word that makes the source ids unique. Three processes would do the same; ports count.
"""

import sys
import threading
import time

import pylsl

word = sys.argv[1]
outlets = [
    pylsl.StreamOutlet(
        pylsl.StreamInfo(f"device-{n}", f"Device{n}", 4, 100.0, "float32", f"{word}-{n}")
    )
    for n in range(10)
]
joints = ["slew", "shoulder", "elbow", "wrist"]
info = pylsl.StreamInfo("gateway.command", "Control", 4, 0.0, "float32", f"{word}-panel")
channels = info.desc().append_child("channels")
for joint in joints:
    channels.append_child("channel").append_child_value("label", joint)
commands = pylsl.StreamOutlet(info)
flows = []


def look() -> None:
    while not (found := pylsl.resolve_byprop("name", "gateway.flow", 1, timeout=1.03)):
        pass
    flows.append(pylsl.StreamInlet(found[0]))
    flows[0].open_stream(240.0)


threading.Thread(target=look, daemon=True).start()
sys.stdout.write("ready\n")
sys.stdout.flush()
while True:
    for outlet in outlets:
        outlet.push_sample([1.0, 2.0, 3.0, time.monotonic()])
    commands.push_sample([0.0, 0.0, 0.0, 0.0])
    time.sleep(0.01)
