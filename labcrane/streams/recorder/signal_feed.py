"""Samples on their way from the recorder to the process of the monitors, and what that answers.

Nothing here waits for a monitor: samples that it does not take in time are left out for it, and
only for it. They are in the journal before they come here.
"""

import json
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from labcrane.core.signals import SignalChannel, SignalStream
from labcrane.limits import LIMITS
from labcrane.processes.handle import SAFELY
from labcrane.processes.watch_clock import WatchClock
from labcrane.recording.foreign_streams import MONITORS, SIGNAL
from labcrane.recording.xdf.header import StreamHeader
from labcrane.streams.request import OURS
from labcrane.types import FloatArray

MOST_BYTES = LIMITS["signals waiting for monitors"].most
"""How much may wait for the monitors: two minutes of 64 channels at 1 kHz."""

HANG_S = 20.0
START_S = 60.0
"""How long a process may load plugins, on a computer that is busy."""

LIVES = 3
PATIENCE_S = 3.0


class SignalTap:
    """One stream's way to the monitors.

    Attributes
    ----------
    faults
        What is wrong now, each with ``channel``, ``kind`` and ``message``.
    failed
        Why a monitor does not look at it any more, by its name.
    """

    def __init__(self, feed: "SignalFeed", note: Callable[..., None]) -> None:
        self.faults: dict[tuple[str, str], Mapping[str, str]] = {}
        self.failed: dict[str, str] = {}
        self.stream: SignalStream | None = None
        self._feed = feed
        self._note = note
        self._number = feed.join(self)

    def begin(self, header: StreamHeader) -> None:
        """Say which stream comes; text has no signal, and our own streams are not from a device."""
        if header.dtype is None or header.name.startswith(OURS):
            return
        channels = tuple(SignalChannel(one.label, one.unit, one.type) for one in header.channels)
        self.stream = SignalStream(header.name, header.type, header.rate_hz, channels)
        self._feed.put(self._number, None)

    def give(self, times: FloatArray, samples: npt.NDArray[Any], first: int) -> None:
        """Pass samples on without waiting; ``first`` is the number of the first one."""
        if self.stream is not None:
            self._feed.put(self._number, (times, samples, first))

    def hear(self, answer: Mapping[str, Any]) -> None:
        """Take up what the monitors answer, and note beside the stream what has changed."""
        if "monitors" in answer:
            self._note(MONITORS, names=answer["monitors"])
        for change in answer["changes"]:
            key = change["channel"], change["kind"]
            if change["bad"]:
                self.faults = {**self.faults, key: change}
            else:
                self.faults = {each: told for each, told in self.faults.items() if each != key}
            self._note(SIGNAL, **change, samples=answer["samples"])
        self.failed = answer["failed"]

    def forget(self) -> None:
        """Withdraw all faults: the monitors restart."""
        for change in self.faults.values():
            self._note(SIGNAL, **{**change, "bad": False})
        self.faults = {}


Samples = tuple[FloatArray, npt.NDArray[Any], int] | None
"""Times, values and the number of the first; None where a stream begins."""


class SignalFeed:
    """Keeps a process of monitors, and feeds it.

    Attributes
    ----------
    fault
        Why signals are not watched any more, or are watched in part; None while all is well.
    left_out
        Chunks that the monitors never saw.

    Parameters
    ----------
    config
        As of :class:`labcrane.monitoring.config.MonitorConfig`.
    hang_s
        After how long without an answer the monitors' process is ended, in seconds.
    """

    def __init__(self, config: Mapping[str, Any], hang_s: float = HANG_S) -> None:
        self._hang_s = hang_s
        self.fault: str | None = None
        self.left_out = 0
        self._command = [
            sys.executable,
            *SAFELY,
            "-m",
            "labcrane.monitoring.process",
            json.dumps(config),
        ]
        self._taps: list[SignalTap] = []
        self._queue: queue.SimpleQueue[tuple[int, Samples] | None] = queue.SimpleQueue()
        self._waiting = 0
        self._asked = 0
        self._answered = 0
        self._clock = WatchClock()
        self._heard = self._clock()
        self._deaths = 0
        self._over = False
        self._process: subprocess.Popen[bytes] | None = None
        self._reader: threading.Thread | None = None
        self._thread = threading.Thread(target=self._run, name="signals", daemon=True)
        self._thread.start()

    def join(self, tap: SignalTap) -> int:
        """Take in another stream; its number."""
        self._taps.append(tap)
        return len(self._taps) - 1

    def put(self, number: int, samples: Samples) -> None:
        """Leave samples to be passed on; when too many wait, they are left out for the monitors."""
        size = 0 if samples is None else samples[1].nbytes
        if self._waiting + size > MOST_BYTES:
            self.left_out += 1
            return
        self._waiting += size
        self._queue.put((number, samples))

    def look(self) -> None:
        """End a process that has not answered for long; another one takes its place."""
        process = self._process
        waits = self._asked > self._answered
        patience = self._hang_s if self._answered else START_S
        if process is not None and waits and self._clock() - self._heard > patience:
            process.kill()

    def close(self) -> None:
        """Let the monitors look at what waits for them, for some seconds at most."""
        self._queue.put(None)
        self._thread.join(PATIENCE_S)
        if self._thread.is_alive() and (hung := self._process) is not None:
            self._over = True  # what still waits is not looked at
            hung.kill()  # its full pipe cannot be closed while something is written to it
            self._thread.join()
        process, reader = self._process, self._reader
        if process is None:
            return
        with suppress(OSError):
            assert process.stdin is not None  # noqa: S101 - it is a pipe
            process.stdin.close()
        try:
            process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if reader is not None:
            reader.join(PATIENCE_S)

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            number, samples = item
            self._waiting -= 0 if samples is None else samples[1].nbytes
            if self._over or self._deaths >= LIVES:
                continue
            try:
                self._send(number, samples)
            except OSError:  # it has died, of whatever a monitor did
                self._bury()

    def _send(self, number: int, samples: Samples) -> None:
        if self._process is None:
            self._start()
            for each, tap in enumerate(self._taps):
                if tap.stream is not None:
                    self._write({"number": each, "stream": asdict(tap.stream)})
            if samples is None:
                return
        if samples is None:
            stream = self._taps[number].stream
            self._write({"number": number, "stream": asdict(stream)} if stream else {})
            return
        times, values, first = samples
        message = {"number": number, "first": first, "rows": len(times), "columns": values.shape[1]}
        body = np.concatenate([times, np.asarray(values, np.float64).ravel()])
        self._write(message, body.astype("<f8").tobytes())

    def _write(self, message: Mapping[str, Any], body: bytes = b"") -> None:
        assert self._process is not None  # noqa: S101 - started before
        assert self._process.stdin is not None  # noqa: S101 - it is a pipe
        if self._asked == self._answered:
            self._heard = self._clock()
        self._asked += 1
        self._process.stdin.write(json.dumps(message).encode() + b"\n" + body)
        self._process.stdin.flush()

    def _start(self) -> None:
        self._asked = self._answered = 0
        self._heard = self._clock()
        process = subprocess.Popen(  # noqa: S603 - ourselves
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert process.stdout is not None  # noqa: S101 - it is a pipe
        self._process = process
        self._reader = threading.Thread(target=self._hear, args=(process.stdout,), daemon=True)
        self._reader.start()

    def _bury(self) -> None:
        """Note that the process died; the next samples start another one, or none."""
        process, self._process = self._process, None
        if process is not None:
            with suppress(OSError):
                assert process.stdin is not None  # noqa: S101 - it is a pipe
                process.stdin.close()
            process.kill()
            process.wait()
            if self._reader is not None:  # what it has answered is heard before it is taken back
                self._reader.join(PATIENCE_S)
        self._deaths += 1
        for tap in self._taps:
            tap.forget()
        again = "started again" if self._deaths < LIVES else "left out from now on"
        self.fault = f"the monitors of signals died {self._deaths} times and are {again}"

    def _hear(self, lines: IO[bytes]) -> None:
        with lines:
            for line in lines:
                answer = json.loads(line)
                self._heard = self._clock()
                self._answered += 1
                self._taps[answer["number"]].hear(answer)
