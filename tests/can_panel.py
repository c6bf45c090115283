"""A control panel in a process of its own: frames over a pty, unplugged for a while on request.

Run as: can_panel.py LINK RATE_HZ SECONDS UNPLUG_AT BACK_AT. Prints "open" when it is listened to,
"unplugged TIME" and "back TIME" (perf_counter) as it does so, how many frames it sent, and the
largest estimated flow of each valve, in percent, that it was told since it was plugged in last.
"""

import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from slcan_adapter import SlcanAdapter

from labcrane_can.avc import encode

link, rate, seconds, unplug_at, back_at = sys.argv[1], *map(float, sys.argv[2:6])
adapter: SlcanAdapter | None = SlcanAdapter(link)
print("ready", flush=True)
while not adapter.opened:
    time.sleep(0.01)
print("open", flush=True)
began, sent = time.perf_counter(), 0
for number in range(round(seconds * rate)):
    due = began + number / rate
    while time.perf_counter() < due:
        time.sleep(0.0005)
    at = number / rate
    if adapter is not None and unplug_at <= at < back_at:
        print("unplugged", time.perf_counter(), flush=True)
        adapter.unplug()
        Path(link).unlink()
        adapter = None
    elif adapter is None and at >= back_at:
        adapter = SlcanAdapter(link)
        print("back", time.perf_counter(), flush=True)
    if adapter is not None:
        if not adapter.opened:  # its time stands still until it is listened to again
            waited = time.perf_counter()
            while not adapter.opened:
                time.sleep(0.0005)
            began += time.perf_counter() - waited
        valve = 1 + number % 4
        adapter.send(*encode(valve, round(200 / valve * math.sin(at)), 0x25))
        sent += 1
told = dict.fromkeys(range(1, 5), 0)
for identifier, data in adapter.sent if adapter else ():
    if (valve := ((identifier >> 8) & 0x3FFFF) - 0xFE10) in told:  # estimated flow, ISO 11783-7
        told[valve] = max(told[valve], abs(data[0] - 125), abs(data[1] - 125))
print("told", *told.values())
print("sent", sent, len(adapter.sent) if adapter else 0, flush=True)
