"""The process that records the streams of others, and outlives the session.

It is started with its orders as JSON, and finds whatever it was asked for, late or again after a
restart. Its own journal is closed some seconds after its pipe ends, so that nothing of the end is
lost; a recorder that was killed is started again and writes the next part.

    python -m labcrane.streams.recorder.process '{"journal": "ses-01_streams.xdf", "streams": []}'

Without the JSON it waits for it as the first line of its standard input.

It reads ``stop`` on its standard input, and writes a line of JSON on its standard output every
second: how each stream is, and whether all that is required flows.
"""

import contextlib
import json
import os
import select
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from labcrane.errors import StreamError
from labcrane.streams.outlets import check_clock
from labcrane.streams.recorder.recorder import Recorder, a_resolver
from labcrane.streams.request import StreamRequest

if TYPE_CHECKING:
    import pylsl

LOOK_S = 0.25
STATUS_S = 1.0
STATUS_FD = 1


@dataclass(frozen=True, slots=True)
class RecorderConfig:
    """What a recorder is to do.

    Attributes
    ----------
    journal
        The first part; a later recorder writes the next one.
    streams
        What to record.
    grace_s
        How long it goes on when whoever started it has died.
    monitors
        What looks at the signals, as of :class:`labcrane.monitoring.config.MonitorConfig`; None for
        nothing.
    """

    journal: Path
    streams: tuple[StreamRequest, ...]
    grace_s: float = 3.0
    monitors: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> "RecorderConfig":
        """Return the orders that JSON holds."""
        known = cls.__dataclass_fields__
        if unknown := sorted(set(fields) - set(known)):
            raise StreamError(
                f"a recorder cannot be told {', '.join(unknown)}; it can be told {', '.join(known)}"
            )
        streams = tuple(StreamRequest.of(one) for one in fields.get("streams", ()))
        rest = {key: value for key, value in fields.items() if key not in ("journal", "streams")}
        return cls(Path(fields["journal"]), streams, **rest)


def main(arguments: Sequence[str]) -> int:
    """Record until told to stop; the process's exit status.

    Without arguments the process loads what it needs, looks around for streams, and waits for its
    orders, a line of JSON on the standard input: a spare recorder takes over at once.
    """
    if arguments:
        return run(RecorderConfig.of(json.loads(arguments[0])))
    resolver = a_resolver()
    orders = await_orders()
    return run(RecorderConfig.of(json.loads(orders)), resolver) if orders else 0


def run(orders: RecorderConfig, resolver: "pylsl.ContinuousResolver | None" = None) -> int:
    """Record until told to stop, or until whoever started it has died.

    ``resolver`` is one that has looked around already.
    """
    check_clock()
    recorder = Recorder(orders.journal, orders.streams, resolver, orders.monitors)
    teller = _Teller()
    with _no_blocking(STATUS_FD):
        try:
            for due in _watch(orders):
                recorder.look()
                if due:
                    teller.tell(recorder.status())
        finally:
            whole = recorder.close()
            if not whole:
                teller.tell(recorder.status())
    return 0 if whole else 1


def await_orders() -> str:
    """Return the line of orders that comes on the standard input; nothing when none comes.

    Read byte by byte: what a buffer holds back, select does not see afterwards.
    """
    line = b""
    while (byte := os.read(0, 1)) not in (b"", b"\n"):
        line += byte
    return line.decode()


def _watch(orders: RecorderConfig) -> Iterator[bool]:
    """Yield several times a second until it is time to end; True when a status is due."""
    stopped, inputs = _signals(), {0}
    ends = float("inf")
    due = 0.0
    while time.monotonic() < ends:
        ready, _, _ = select.select([*inputs, stopped], [], [], LOOK_S)
        if stopped in ready or (0 in ready and _told_to_stop(inputs)):
            return
        if ends == float("inf") and not inputs:  # what the session's streams still send is recorded
            ends = time.monotonic() + orders.grace_s
        status = time.monotonic() >= due
        if status:
            due = time.monotonic() + STATUS_S
        yield status


def _told_to_stop(inputs: set[int]) -> bool:
    """Whether the line just read says stop; at the pipe's end it is listened to no more."""
    text = os.read(0, 4096)
    if not text:
        inputs.discard(0)
    return b"stop" in text


def _signals() -> int:
    """Return a descriptor that becomes readable when the process is asked to end."""
    told, tell = os.pipe()
    os.set_blocking(tell, False)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: None)
    signal.set_wakeup_fd(tell)
    return told


@contextlib.contextmanager
def _no_blocking(descriptor: int) -> Iterator[None]:
    """Let writes fail rather than wait for a reader that hangs."""
    before = os.get_blocking(descriptor)
    os.set_blocking(descriptor, False)
    try:
        yield
    finally:
        os.set_blocking(descriptor, before)


class _Teller:
    """Writes lines of status; a reader that hangs or has died misses some, but gets whole ones."""

    def __init__(self) -> None:
        self._rest = b""

    def tell(self, status: Mapping[str, Any]) -> None:
        """Write a line unless the reader has not taken the one before."""
        if not self._rest:
            self._rest = json.dumps(status).encode() + b"\n"
        with contextlib.suppress(BlockingIOError, BrokenPipeError):
            self._rest = self._rest[os.write(STATUS_FD, self._rest) :]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
