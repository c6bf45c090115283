"""A control panel in a process of its own: frames over a pty, unplugged for a while on request.

Run as: can_panel.py LINK RATE_HZ SECONDS UNPLUG_AT BACK_AT. Prints "open" when it is listened to,
"unplugged TIME" and "back TIME" (perf_counter) as it does so, and how many frames it sent.
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
        level = round(200 * math.sin(at))
        adapter.send(*encode(1 + number % 4, level, 0x25))
        sent += adapter.opened
print("sent", sent, len(adapter.sent) if adapter else 0, flush=True)
