"""A stream that sends chunks of 16, whose first receiver connects in the middle of one.

Arguments: name, source id. The first channel counts; sample n is of the time ``began + n / 250``,
and the second channel says which that is.
"""

import sys
import time

import pylsl

RATE_HZ, CHUNK = 250.0, 16
DEDUCED = -1.0
"""What liblsl is given in place of the stamp of a sample that belongs to a chunk."""

name, source_id = sys.argv[1:]
info = pylsl.StreamInfo(name, "EEG", 2, RATE_HZ, "double64", source_id)
outlet = pylsl.StreamOutlet(info)
while not outlet.wait_for_consumers(1.0):
    pass
count = 5  # of the chunk under way: those before went to nobody
began = pylsl.local_clock() - count / RATE_HZ
while True:
    due = began + count / RATE_HZ
    time.sleep(max(0.0, due - pylsl.local_clock()))
    stamp = DEDUCED if count % CHUNK else due
    outlet.push_sample([count, due], stamp, pushthrough=count % CHUNK == CHUNK - 1)
    count += 1
