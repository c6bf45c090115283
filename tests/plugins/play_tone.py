"""Plays a moving tone on the JACK server; prints samples played and changes given."""

import sys
import time

from labcrane.testing import TARGETS, a_run, a_target, ch8
from labcrane_sonification.settings import SonificationSettings
from labcrane_sonification.sonification import Sonification

run = a_run(ch8(), task=TARGETS)
sonification = Sonification(SonificationSettings(driver="jack", block=1024))
sonification.open(run)
began = time.perf_counter()
first = last = changes = 0.0
while time.perf_counter() - began < float(sys.argv[1]):
    last = sonification.present(a_target(run, int(changes) % 200))[4]
    first = first or last
    changes += 1
    time.sleep(0.008)
sonification.close()
sys.stdout.write(f"{last - first} {changes}\n")
