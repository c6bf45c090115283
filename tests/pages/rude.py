"""A client that loads the page and connects again and again, and one that never reads.

A line on its standard input lets it loose for a spell; then it says how often it got in. A browser
is on another computer, so this runs at the lowest priority: what is measured is what the pages do
to the loop, not what a client's own work does to a computer that both share.
"""

import http.client
import os
import socket
import sys
import time

port, request, cookie = int(sys.argv[1]), sys.argv[2].encode(), sys.argv[3]
times, spell = int(sys.argv[4]), float(sys.argv[5])


def gets_in() -> bool:
    link = http.client.HTTPConnection("127.0.0.1", port)
    link.request("GET", "/supervisor", headers={"Cookie": cookie})
    loaded = link.getresponse().status == 200
    link.close()
    with socket.create_connection(("127.0.0.1", port)) as wire:
        wire.sendall(request)
        return loaded and wire.recv(64).startswith(b"HTTP/1.1 101")


os.nice(19)
for _ in sys.stdin:
    ends = time.perf_counter() + spell
    with socket.create_connection(("127.0.0.1", port)) as silent:
        silent.sendall(request)
        opened = 0
        while opened < times:  # the door lets in so many a second
            opened += gets_in()
        time.sleep(max(0.0, ends - time.perf_counter()))
    sys.stdout.write(f"{opened}\n")
    sys.stdout.flush()
