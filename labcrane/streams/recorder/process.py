"""The process that records the external streams, and outlives the session.

It finds whatever it was asked for, late or again after a restart. Its own journal is closed some
seconds after its parent has died, so that nothing of the end is lost.

A launcher starts it by a :class:`labcrane.processes.handle.ProcessHandle`, before there is anything
to record: it has loaded everything and waits for its :class:`RecorderConfig`. It receives ``stop``,
descriptions of streams it need not search for, and which stream of a type was confirmed,
and reports every second how each stream is, and whether all that is required flows. By hand, its
orders are JSON, ``stop`` is a line of its standard input, a status a line of its standard output:

    python -m labcrane.streams.recorder.process '{"journal": "ses-01_streams.xdf", "streams": []}'
"""

import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from labcrane.errors import StreamError
from labcrane.processes.messages import Inbox
from labcrane.processes.parent import Parent
from labcrane.streams.outlets import check_clock
from labcrane.streams.recorder.recorder import Recorder
from labcrane.streams.request import StreamRequest

LOOK_S = 0.25
STATUS_S = 1.0
STOP = "stop"
KNOWN = "known"
"""Of a message: descriptions of streams that are there now."""

CONFIRMED = "confirmed"
"""Of a message: which stream of its type is meant, by the study's name for it."""

STATUS_FD = 1


class Chief(Protocol):
    """A connection that can stop a recorder, and receives its status."""

    gone: threading.Event
    """Set when it has died."""

    def messages(self) -> list[Any]:
        """Return what it has said since the last call."""

    def wait(self, seconds: float) -> bool:
        """Wait for a message or its end."""

    def tell(self, message: Mapping[str, Any]) -> None:
        """Tell it something without waiting for it."""


@dataclass(frozen=True, slots=True)
class RecorderConfig:
    """What a recorder is to do.

    Attributes
    ----------
    journal
        The first part.
    streams
        What to record.
    grace_s
        How long it continues after its parent has died.
    part
        Which part it writes, counted from 1; None for the first that there is not yet.
    known
        Descriptions of streams that another recorder has found, so that they need no search.
    monitors
        What looks at the signals, as of :class:`labcrane.monitoring.config.MonitorConfig`; None for
        nothing.
    """

    journal: Path
    streams: tuple[StreamRequest, ...]
    grace_s: float = 3.0
    part: int | None = None
    known: tuple[str, ...] = ()
    monitors: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> "RecorderConfig":
        """Return the orders that JSON holds."""
        known = cls.__dataclass_fields__
        if unknown := sorted(set(fields) - set(known)):
            raise StreamError(
                f"a recorder has no setting {', '.join(unknown)}; it has {', '.join(known)}"
            )
        streams = tuple(StreamRequest.of(one) for one in fields.get("streams", ()))
        rest = {key: value for key, value in fields.items() if key not in ("journal", "streams")}
        return cls(Path(fields["journal"]), streams, **rest)


def main(arguments: Sequence[str]) -> int:
    """Record until told to stop; the process's exit status.

    Without arguments the process loads what it needs and waits for its orders from the launcher.
    """
    if arguments:
        terminal = _Terminal()
        status = run(RecorderConfig.of(json.loads(arguments[0])), terminal)
        terminal.close()
        return status
    import pylsl  # noqa: F401, PLC0415 - loaded before there is something to record

    parent = Parent()
    if (orders := parent.order()) is None:
        return 0
    status = run(orders, parent)
    parent.close()
    return status


def run(orders: RecorderConfig, chief: Chief) -> int:
    """Record until told to stop, or until the parent has died."""
    check_clock()
    recorder = Recorder(orders.journal, orders.streams, orders.part, orders.known, orders.monitors)
    try:
        for due in _watch(orders, chief, recorder):
            recorder.look()
            if due:
                chief.tell(recorder.status())
    finally:
        whole = recorder.close()
        if not whole:
            chief.tell(recorder.status())
    return 0 if whole else 1


def _watch(orders: RecorderConfig, chief: Chief, recorder: Recorder) -> Iterator[bool]:
    """Yield several times a second until it is time to end; True when a status is due."""
    asked = _signals()
    ends = float("inf")
    due = 0.0
    while time.monotonic() < ends:
        said = chief.messages()
        if STOP in said or asked.is_set():
            return
        for told in said:
            if isinstance(told, Mapping):
                recorder.know(told.get(KNOWN, ()))
                for label, key in told.get(CONFIRMED, {}).items():
                    recorder.confirm(label, key)
        if chief.gone.is_set():
            if ends == float("inf"):  # what the session's streams still send is recorded
                ends = time.monotonic() + orders.grace_s
            asked.wait(LOOK_S)
        else:
            chief.wait(LOOK_S)
        status = time.monotonic() >= due
        if status:
            due = time.monotonic() + STATUS_S
        yield status


def _signals() -> threading.Event:
    """Return what is set when the process is asked to end."""
    asked = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: asked.set())
    return asked


class _Terminal:
    """Terminal of a recorder that was started by hand: reads and writes lines, in threads.

    A reader that hangs or has died misses some lines, but gets whole ones.
    """

    def __init__(self) -> None:
        self.gone = threading.Event()
        self._inbox: Inbox[str] = Inbox()
        self._outgoing: queue.Queue[bytes] = queue.Queue(1)
        self._speaker = threading.Thread(target=self._speak, daemon=True)
        self._speaker.start()
        threading.Thread(target=self._hear, daemon=True).start()

    def messages(self) -> list[str]:
        return self._inbox.messages()

    def wait(self, seconds: float) -> bool:
        return self._inbox.wait(seconds)

    def tell(self, message: Mapping[str, Any]) -> None:
        with suppress(queue.Full):
            self._outgoing.put_nowait(json.dumps(message).encode() + b"\n")

    def close(self) -> None:
        with suppress(queue.Full):
            self._outgoing.put(b"", timeout=1.0)
        self._speaker.join(1.0)

    def _hear(self) -> None:
        rest = b""
        while text := os.read(0, 4096):
            *lines, rest = (rest + text).split(b"\n")
            for line in lines:
                self._inbox.put(line.decode(errors="replace").strip())
        self.gone.set()
        self._inbox.wake()

    def _speak(self) -> None:
        with suppress(OSError):
            while line := self._outgoing.get():
                while line:
                    line = line[os.write(STATUS_FD, line) :]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
