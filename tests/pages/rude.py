"""A client that connects again and again, and one that never reads; says how often it got in.

A browser is on another computer, so this runs at the lowest priority: what is measured is what the
pages do to the loop, not what a client's own work does to a computer that both share.
"""

import os
import socket
import sys
import time

port, request, times, spell = int(sys.argv[1]), sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
os.nice(19)
ends = time.perf_counter() + spell
silent = socket.create_connection(("127.0.0.1", port))
silent.sendall(request.encode())
opened = 0
for _ in range(times):
    with socket.create_connection(("127.0.0.1", port)) as link:
        link.sendall(request.encode())
        opened += link.recv(64).startswith(b"HTTP/1.1 101")
time.sleep(max(0.0, ends - time.perf_counter()))
sys.stdout.write(f"{opened}\n")
