"""A control panel in a process of its own: frames over a pty, unplugged for a while on request.

Run as: can_panel.py LINK RATE_HZ AWAY_S. Its levers swing for as long as it is not told "end"; told
"unplug", it is away for a while. Prints "open" when it is listened to, "unplugged TIME" and "back
TIME" (perf_counter) as it does so, how many frames it sent, and the largest estimated flow of each
valve, in percent, that it was told since it was plugged in last.
"""

import math
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from slcan_adapter import SlcanAdapter

from labcrane_can.avc import encode

link, rate, away_s = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
words: list[str] = []
reader = threading.Thread(target=lambda: words.extend(map(str.strip, sys.stdin)), daemon=True)
adapter: SlcanAdapter | None = SlcanAdapter(link)
print("ready", flush=True)
while not adapter.opened:
    time.sleep(0.01)
print("open", flush=True)
reader.start()
number, sent, returns = 0, 0, math.inf
while "end" not in words:
    time.sleep(1.0 / rate)
    if adapter is not None and "unplug" in words and returns == math.inf:
        print("unplugged", time.perf_counter(), flush=True)
        adapter.unplug()
        Path(link).unlink()
        adapter, returns = None, time.perf_counter() + away_s
    elif adapter is None and time.perf_counter() >= returns:
        adapter = SlcanAdapter(link)
        print("back", time.perf_counter(), flush=True)
    if adapter is not None and adapter.opened:  # else its levers stand still
        number += 1
        valve = 1 + number % 4
        adapter.send(*encode(valve, round(200 / valve * math.sin(number / rate)), 0x25))
        sent += 1
told = dict.fromkeys(range(1, 5), 0)
for identifier, data in adapter.sent if adapter else ():
    if (valve := ((identifier >> 8) & 0x3FFFF) - 0xFE10) in told:  # estimated flow, ISO 11783-7
        told[valve] = max(told[valve], abs(data[0] - 125), abs(data[1] - 125))
print("told", *told.values())
print("sent", sent, len(adapter.sent) if adapter else 0, flush=True)
