"""Writes down every state sample that reaches it, of every session of one study, as it comes.

Argument: the study. Output: a JSON line per sample: its stamp and its values. Asked to end
(SIGTERM), it does so when all that was sent has come: when every stream that it knows has ended, or
does not answer any more and has nothing left.
"""

import json
import signal
import sys
import time

import pylsl
from pylsl.util import LostError

study = sys.argv[1]
resolver = pylsl.ContinuousResolver(prop="name", value="labcrane.state", forget_after=2.0)
inlets = {}
asked = []
signal.signal(signal.SIGTERM, lambda *_: asked.append(True))
sys.stdout.write("ready\n")
going_on = {""}
while not asked or going_on:
    found = resolver.results()
    going_on = {info.uid() for info in found} & {uid for uid, inlet in inlets.items() if inlet}
    for info in found:
        if info.source_id().startswith(f"labcrane/{study}/") and info.uid() not in inlets:
            inlets[info.uid()] = pylsl.StreamInlet(info, recover=False)
    for uid, inlet in list(inlets.items()):
        try:
            samples, stamps = inlet.pull_chunk(0.0) if inlet else ([], [])
        except LostError:
            inlets[uid] = None
            continue
        if samples:
            going_on.add(uid)
        for sample, stamp in zip(samples, stamps, strict=True):
            sys.stdout.write(json.dumps([stamp, sample]) + "\n")
    sys.stdout.flush()
    time.sleep(0.005)
