"""Plays a moving tone, or silence, on the JACK server; prints samples played and changes given."""

import os
import sys
import time

os.environ.setdefault("PYO_GUI_WX", "0")
import pyo

from labcrane.testing import TARGETS, a_run, a_target, ch8
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.sonification import Sonification

run = a_run(ch8(), task=TARGETS)
silent = sys.argv[2:] == ["silent"]
if silent:
    server = pyo.Server(
        sr=48000, nchnls=2, buffersize=1024, duplex=0, audio="jack", jackname="silent"
    )
    server.deactivateMidi()
    server.boot().start()
else:
    sonification = Sonification(SonificationSettings(driver="jack", block=1024))
    sonification.open(run)
began = time.perf_counter()
first = last = changes = 0.0
while time.perf_counter() - began < float(sys.argv[1]):
    if silent:
        last = float(server.getCurrentTimeInSamples())
    else:
        last = sonification.present(a_target(run, int(changes) % 200))[4]
    first = first or last
    changes += 1
    time.sleep(0.008)
if silent:
    server.stop()
    server.shutdown()
else:
    sonification.close()
sys.stdout.write(f"{last - first} {changes}\n")
