"""Writes down every state sample that reaches it, of every session of one study, as it comes.

Argument: the study. Output: a JSON line per sample: its stamp and its values. Asked to end
(SIGTERM), it does so when all that was sent has come: when every stream that it knows has ended.
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
while not asked or any(inlets.values()):
    for info in resolver.results():
        if info.source_id().startswith(f"labcrane/{study}/") and info.uid() not in inlets:
            inlets[info.uid()] = pylsl.StreamInlet(info, recover=False)
    for uid, inlet in list(inlets.items()):
        try:
            samples, stamps = inlet.pull_chunk(0.0) if inlet else ([], [])
        except LostError:
            inlets[uid] = None
            continue
        for sample, stamp in zip(samples, stamps, strict=True):
            sys.stdout.write(json.dumps([stamp, sample]) + "\n")
    sys.stdout.flush()
    time.sleep(0.005)
