"""A gateway written from docs/gateway.md alone: it imports pylsl and nothing of labcrane."""

import sys
import time

import pylsl

JOINTS = ["base", "arm", "boom", "jaws"]
info = pylsl.StreamInfo("gateway.command", "Control", len(JOINTS), 0.0, "float32", "my-panel")
channels = info.desc().append_child("channels")
for joint in JOINTS:
    channels.append_child("channel").append_child_value("label", joint)
outlet = pylsl.StreamOutlet(info)
seconds, most = float(sys.argv[1]), 0.0
flow, flows = None, pylsl.ContinuousResolver(prop="name", value="gateway.flow")
began = None  # when the session's own stream was found
while began is None or time.monotonic() - began < seconds:
    outlet.push_sample([0.0, 120.0, 0.0, 0.0])
    if flow is None and (found := flows.results()):
        flow, began = pylsl.StreamInlet(found[0]), time.monotonic()
    if flow is not None:
        while (sample := flow.pull_sample(timeout=0.0))[1] is not None:
            most = max(most, sample[0][1])
    time.sleep(0.03)
print(most)
