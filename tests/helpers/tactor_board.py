"""A board with tactors: our own sketch, compiled for this computer, at the other end of a line.

What the board would do to its pins is written to a log: seconds of the monotonic clock, which is
the session's, the pin, and its level.
"""

import os
import pty
import socket
import subprocess
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from needs import need

import labcrane_vibration

SKETCH = Path(labcrane_vibration.__file__).with_name("tactors.ino")

ARDUINO = r"""
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#define OUTPUT 1
static int line_fd;
static FILE *pins;
static int levels[64];
static double now() {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}
unsigned long millis() { return (unsigned long)(1e3 * now()); }
unsigned long micros() { return (unsigned long)(unsigned int)(long long)(1e6 * now()); }
void pinMode(int, int) {}
void analogWrite(int pin, int level) {
  if (levels[pin] == level) return;
  levels[pin] = level;
  fprintf(pins, "%.6f %d %d\n", now(), pin, level);
  fflush(pins);
}
struct Port {
  char out[128];
  int n;
  void begin(long) { n = 0; }
  int available() {
    struct pollfd one = {line_fd, POLLIN, 0};
    return poll(&one, 1, 1) > 0 && (one.revents & POLLIN);
  }
  int read() {
    unsigned char sign;
    return ::read(line_fd, &sign, 1) == 1 ? sign : -1;
  }
  void print(const char *text) { n += snprintf(out + n, sizeof(out) - n, "%s", text); }
  void print(long value) { n += snprintf(out + n, sizeof(out) - n, "%ld", value); }
  void print(unsigned long value) { n += snprintf(out + n, sizeof(out) - n, "%lu", value); }
  void println(int value) {
    n += snprintf(out + n, sizeof(out) - n, "%d\r\n", value);
    if (write(line_fd, out, n) != n) exit(1);
    n = 0;
  }
} Serial;
#include "tactors.ino"
int main(int, char **words) {
  line_fd = atoi(words[1]);
  pins = fopen(words[2], "w");
  setup();
  for (;;) loop();
}
"""

FOLDER = Path(os.environ.get("TMPDIR", "/tmp")) / f"labcrane-board-{os.getuid()}-{os.getpid()}"


@cache
def board_program() -> Path:
    """Return the compiled sketch."""
    need("g++")
    FOLDER.mkdir(exist_ok=True)
    source, program = FOLDER / "board.cpp", FOLDER / "board"
    source.write_text(ARDUINO)
    subprocess.run(
        ["g++", "-O1", "-Wall", "-Werror", f"-I{SKETCH.parent}", "-o", program, source], check=True
    )
    return program


@dataclass
class Board:
    """A board: where it is connected, and the log of its pins."""

    address: str
    log: Path
    process: subprocess.Popen[bytes]

    def changes(self) -> list[tuple[float, int, int]]:
        """Return time, pin and level of each change of a pin."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        rows = [line.split() for line in lines]
        return [(float(time), int(pin), int(level)) for time, pin, level in rows]

    def vibrates(self) -> bool:
        """Whether any pin is on now."""
        return any({pin: level for _, pin, level in self.changes()}.values())


@contextmanager
def serial_board(folder: Path) -> Iterator[Board]:
    """Connect a board to a serial line."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    log = folder / "pins.txt"
    process = subprocess.Popen([board_program(), str(ours), log], pass_fds=[ours])
    try:
        yield Board(os.ttyname(theirs), log, process)
    finally:
        process.kill()
        process.wait()
        os.close(ours)
        os.close(theirs)


@contextmanager
def udp_board(folder: Path) -> Iterator[Board]:
    """Connect a board by UDP: a thread passes its lines on."""
    line, boards = socket.socketpair()
    network = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    network.bind(("127.0.0.1", 0))
    log = folder / "pins.txt"
    process = subprocess.Popen(
        [board_program(), str(boards.fileno()), log], pass_fds=[boards.fileno()]
    )
    peers: list[object] = []

    def inward() -> None:
        while True:
            text, peer = network.recvfrom(100)
            if text == b"stop":
                return
            peers[:] = [peer]
            line.sendall(text)

    def outward() -> None:
        while text := line.recv(100):
            network.sendto(text, peers[0])  # type: ignore[arg-type]

    threads = [threading.Thread(target=each) for each in (inward, outward)]
    for thread in threads:
        thread.start()
    host, port = network.getsockname()
    try:
        yield Board(f"{host}:{port}", log, process)
    finally:
        process.kill()
        process.wait()
        network.sendto(b"stop", (host, port))
        line.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join()
        for each in (line, boards, network):
            each.close()
