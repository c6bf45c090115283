"""A whole laboratory in a network of its own, with LSL's default ports: what it takes of them.

Arguments: a folder, and how often it is begun. Prints JSON for each: seconds until it could begin,
and the most ports of LSL's range that were taken at once, by all programs and by each one.
"""

import fcntl
import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import psutil
from simple_crane import CRANE

FIRST, PORTS = 16572, 32
WORDS = ("ten_devices", "recorder.process", "feedback.process", "crowded_run")
HERE = Path(__file__).parent

PLUGIN = '''
import numpy as np
from labcrane import Feedback, Settings, Signal, hookimpl, offer

labcrane_api = 1


class PlainSettings(Settings):
    """A sound that nobody hears."""


class Plain(Feedback):
    signals = (Signal("seen", "1"),)

    def __init__(self):
        self._seen = 0.0

    def present(self, frame):
        self._seen += 1.0
        return np.array([self._seen])


@hookimpl
def labcrane_feedback():
    return [offer("plain", PlainSettings, Plain)]
'''

STUDY = (
    """\
labcrane: 1
study: {word}
title: A laboratory full of streams
rate_hz: 120
"""
    + CRANE.replace("dual_joystick", "gateway")
    .replace("left.x", "valve.slew")
    .replace("left.y", "valve.elbow")
    .replace("-right.y", "valve.shoulder")
    .replace("right.x", "valve.wrist")
    .replace("{", "{{")
    .replace("}", "}}")
    + """\
tasks:
  aiming: {{use: aiming, distances: [2], movements: 1, limit_s: 5}}
feedback:
  ball: {{use: sphere}}
  tone: {{use: plain}}
  hum: {{use: plain}}
views:
  operator: {{use: view, display: hidden, renderer: software, size: [160, 90], rate_hz: 20}}
  examiner: {{use: view, display: hidden, renderer: software, size: [160, 90], rate_hz: 20}}
  mirror: {{use: view, display: hidden, renderer: software, size: [160, 90], rate_hz: 20}}
streams:
{streams}
sessions: [{{name: only, steps: [{{block: {{task: aiming}}}}]}}]
"""
)


def loopback_up() -> None:
    """Bring up the loopback of this network namespace."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, 0x8914, struct.pack("16sh14x", b"lo", 0x1 | 0x40))  # SIOCSIFFLAGS


def taken() -> tuple[set[int], set[int], Counter[int]]:
    """Return the ports of LSL's range that are taken, UDP and TCP, and how many by each process."""
    udp, tcp, by = set(), set(), Counter()
    for one in psutil.net_connections("inet"):
        if not one.laddr or not FIRST <= one.laddr.port < FIRST + PORTS:
            continue
        if one.type == socket.SOCK_DGRAM:
            udp.add(one.laddr.port)
            by[one.pid] += 1
        elif one.status == psutil.CONN_LISTEN:
            tcp.add(one.laddr.port)
    return udp, tcp, by


def named(by: "Counter[int]") -> dict[str, int]:
    """Return the most UDP ports that one process of a kind has."""
    found: dict[str, int] = {}
    for pid, count in by.items():
        try:
            line = psutil.Process(pid).cmdline()
        except psutil.NoSuchProcess:
            continue
        what = next(
            (word for word in WORDS if any(word in part for part in line)), "session or page"
        )
        found[what] = max(count, found.get(what, 0))
    return found


def begin(folder: Path, number: int) -> dict[str, object]:
    word = f"crowd-{os.getpid()}-{number}"
    streams = "\n".join(f"  device{n}: {{source_id: {word}-{n}}}" for n in range(10))
    (folder / "study.yaml").write_text(STUDY.format(word=word, streams=streams))
    devices = subprocess.Popen(
        [sys.executable, str(HERE / "ten_devices.py"), word], stdout=subprocess.PIPE, text=True
    )
    devices.stdout.readline()
    words = ["run", "study.yaml", "--participant", f"P{number:03d}", "--local", "--pilot"]
    began = time.monotonic()
    run = subprocess.Popen(
        [sys.executable, "-m", "labcrane", *words],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    over = threading.Event()
    most = {"udp": 0, "tcp": 0}
    holders: dict[str, int] = {}

    def count() -> None:
        while not over.wait(0.1):
            udp, tcp, by = taken()
            for what, held in named(by).items():
                holders[what] = max(held, holders.get(what, 0))
            most["udp"], most["tcp"] = max(most["udp"], len(udp)), max(most["tcp"], len(tcp))

    counter = threading.Thread(target=count)
    counter.start()
    said, took = [], None
    try:
        for line in run.stdout:
            said.append(line.rstrip())
            if "space to start" in line:
                run.stdin.write("start\n")
                run.stdin.flush()
            if "Block 1 began" in line and took is None:
                took = time.monotonic() - began
                over.set()
                run.stdin.write("end\n")
                run.stdin.flush()
            if time.monotonic() - began > 240.0:
                break
    finally:
        over.set()
        counter.join()
        run.terminate() if run.poll() is None else None
        devices.kill()
        devices.wait()
        run.wait(240)
    return {"took": took, **most, "holders": holders, "said": said[-12:] if took is None else []}


if __name__ == "__main__":
    loopback_up()
    where = Path(sys.argv[1])
    (where / "plugins").mkdir()
    (where / "plugins" / "plain.py").write_text(PLUGIN)
    for number in range(int(sys.argv[2])):
        sys.stdout.write(json.dumps(begin(where, number + 1)) + "\n")
        sys.stdout.flush()
