"""Plays a moving tone on the JACK server; argument: seconds, and ``holding`` to hold pyo up.

Holding keeps Python's global lock, without which pyo cannot compute, for five and a half blocks.
Prints as JSON what it has come to.
"""

import ctypes
import json
import os
import sys
import time

from labcrane.testing import TARGETS, ch8, make_run, make_target
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.sonification import Sonification

BLOCK, RATE = 1024, 48000
run = make_run(ch8(), task=TARGETS)
seconds, holding = float(sys.argv[1]), sys.argv[2:] == ["holding"]
with_lock = ctypes.PyDLL(None)
sonification = Sonification(SonificationSettings(driver="jack", block=BLOCK, rate_hz=RATE))
sonification.open(run)
facts, policy = sonification.metadata(), os.sched_getscheduler(0)
began = time.perf_counter()
first = values = sonification.present(make_target(run))
changes = holds = 0
while (passed := time.perf_counter() - began) < seconds:
    changes += 1
    values = sonification.present(make_target(run, changes % 200))
    if holding and passed > 0.5 * (1 + holds):
        with_lock.usleep(round(5.5e6 * BLOCK / RATE))
        holds += 1
    time.sleep(0.008)
sonification.close()
result = {
    "played": values[4] - first[4],
    "missed": values[5],
    "changes": changes,
    "holds": holds,
    "scheduling": facts["scheduling"],
    "real time": policy == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK,
    "ordinary again": os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_OTHER,
}
sys.stdout.write(json.dumps(result) + "\n")
