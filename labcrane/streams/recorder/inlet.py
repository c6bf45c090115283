"""One stream of another program, received and written down as it comes."""

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from labcrane.errors import RecordingError
from labcrane.recording.foreign_streams import COUNTER_GAP, OPENED, RESET, TAKEN
from labcrane.recording.xdf.header import StreamHeader
from labcrane.recording.xdf.writer import XdfWriter
from labcrane.streams.probes import ClockProbe
from labcrane.streams.recorder.companions import RecordedStreamWriter
from labcrane.streams.recorder.health import Counter, Flow
from labcrane.streams.recorder.signal_feed import SignalFeed, SignalTap
from labcrane.types import FloatArray

if TYPE_CHECKING:
    import pylsl

PULL_S = 0.03
PROBE_S = 0.25
RETRY_S = 0.25
BUFFER_S = 360
"""How long liblsl keeps samples that are not pulled: a disk may be full for as long."""

SILENT_S = 1.0
MOST = 8192


class Inlet:
    """Receives a stream in two threads, one for samples, one for clock probes.

    liblsl corrects nothing here: its own correction mis-stamps samples when a source restarts. Nor
    does it search for a source that is gone: it would take any that looks alike, and would find
    none whose ports are out of reach. The recorder finds it, and tells by :meth:`follow`.

    Parameters
    ----------
    info
        The stream as it was found.
    writer
        Where it goes.
    counter
        Label of the channel that counts samples, if there is one.
    warnings
        What is known to be wrong with it, noted beside the stream.
    feed
        To whom its samples are passed on, to see whether its signal is alive.
    taken
        Which stream it is, noted beside it, where any of its type was meant.
    """

    def __init__(
        self,
        info: "pylsl.StreamInfo",
        writer: XdfWriter,
        counter: str | None = None,
        warnings: tuple[str, ...] = (),
        feed: SignalFeed | None = None,
        taken: str | None = None,
    ) -> None:
        self.info = info
        self.flow = Flow()
        self.header: StreamHeader | None = None
        self._writer = writer
        self._counter_label = counter
        self._warnings = warnings
        self._taken = taken
        self._stop = threading.Event()
        self._give_up = threading.Event()
        self._leave = threading.Event()
        self._companions: RecordedStreamWriter | None = None
        self._next: pylsl.StreamInfo | None = None
        self._clock: ClockProbe | None = None
        self._silent = False
        self.signals = None if feed is None else SignalTap(feed, self.note)
        name = info.name()
        self._threads = [
            threading.Thread(target=self._watched, args=(self._receive,), name=f"pull {name}")
        ]
        self._threads[0].daemon = True
        self._threads[0].start()

    @property
    def alive(self) -> bool:
        """Whether anything is still being received or written."""
        return any(thread.is_alive() for thread in self._threads)

    def follow(self, info: "pylsl.StreamInfo") -> None:
        """Receive this source of the stream as soon as the present one is lost."""
        if info.uid() != self.info.uid():
            self._next = info

    def leave(self) -> None:
        """Take the present source for lost: its connection was never closed."""
        self._leave.set()

    def note(self, event: str, **data: object) -> None:
        """Write a note beside the stream; left out before its header is known."""
        companions = self._companions
        if companions is not None:
            self._insist(lambda: companions.note(_now(), event, **data))

    def close(self, patience_s: float = 5.0) -> bool:
        """Take what has come, stop, and let go of the stream.

        Whether that went well: not when the disk did not take it within ``patience_s``.
        """
        self._stop.set()
        deadline = time.monotonic() + patience_s
        for thread in self._threads:
            thread.join(max(deadline - time.monotonic(), 0.0))
        self._give_up.set()
        for thread in self._threads:
            thread.join(2.0)
        return self.flow.fault is None and not self.alive

    def _watched(self, work: Callable[[], None]) -> None:
        """Do a thread's work, and report it if it fails."""
        try:
            work()
        finally:
            if not self._stop.is_set() and self.flow.fault is None:
                self.flow.fault = (
                    f"{self.info.name()} is not received any more; restart the recorder"
                )

    def _receive(self) -> None:
        if (found := self._connected()) is None:
            return
        inlet, header = found
        counter = Counter.of(header, self._counter_label)
        opened: list[RecordedStreamWriter] = []
        self._insist(lambda: opened.append(RecordedStreamWriter(self._writer, header)))
        if not opened:
            return
        companions = self._companions = opened[0]
        self.header = header
        self.note(OPENED)
        for text in self._warnings:
            self.note("warning", text=text)
        if self._taken is not None:
            self.note(TAKEN, text=self._taken)
        if self.signals is not None:
            self.signals.begin(header)
        self._clock = ClockProbe(inlet)
        prober = threading.Thread(
            target=self._watched,
            args=(partial(self._probe, companions),),
            name=f"probe {header.name}",
            daemon=True,
        )
        self._threads.append(prober)
        prober.start()
        while True:
            stopping = self._stop.wait(PULL_S)
            came, lost = self._pull(inlet, companions, counter)
            self._mark_silence(came=came)
            if stopping:
                break
            if (lost or self._leave.is_set()) and (again := self._connected(header)) is not None:
                inlet = again[0]
                self._clock = ClockProbe(inlet)
                if counter is not None:
                    counter.forget()
        prober.join()

    def _connected(
        self, before: StreamHeader | None = None
    ) -> "tuple[pylsl.StreamInlet, StreamHeader] | None":
        """Return a source that sends to us, and its header; None when recording ends before.

        It may be the one that was lost: then only the network was away.
        """
        while not self._stop.is_set():
            for info in filter(None, (self._next, self.info)):
                try:
                    inlet, header = _open(info)
                except (TimeoutError, RuntimeError):  # pylsl's LostError is a RuntimeError
                    continue
                except RecordingError as error:
                    self.flow.fault = str(error)
                    return None
                if before is not None and info.uid() != self.info.uid():
                    self._replaced(info, before, header)
                self.info, self._next = info, None
                self._leave.clear()
                return inlet, header
            self._mark_silence(came=False)
            self._stop.wait(RETRY_S)
        return None

    def _replaced(
        self, info: "pylsl.StreamInfo", before: StreamHeader, header: StreamHeader
    ) -> None:
        """Note that the next sample is another source's, and what about it is not as it was."""
        first = self.flow.samples
        self.flow.resets += 1
        self.note(RESET, samples=[first, first])
        if info.hostname() != self.info.hostname():
            self._warn(
                f"was sent by {self.info.hostname()} and came back from {info.hostname()}: check "
                "that it is the same one"
            )
        if header.channels != before.channels:
            self._warn(
                "came back with other labels, types or units of its channels; the recording keeps "
                f"the first: check the montage, {header.labels} now"
            )

    def _warn(self, text: str) -> None:
        if text not in self.flow.warnings:
            self.flow.warnings.append(text)
            self.note("warning", text=text)

    def _pull(
        self, inlet: "pylsl.StreamInlet", companions: RecordedStreamWriter, counter: Counter | None
    ) -> tuple[bool, bool]:
        """Write down all that has come; whether anything had, and whether the source is lost."""
        chunks = []
        lost = False
        waiting = MOST
        while waiting in (0, MOST):
            # Not more than there are: liblsl drops what it has pulled if it finds a loss then.
            waiting = min(inlet.samples_available(), MOST)
            try:
                data, stamps = inlet.pull_chunk(0.0, waiting or 1)
            except RuntimeError:
                lost = True
                break
            if not len(stamps):
                break
            chunks.append((_now(), np.asarray(stamps), np.asarray(data)))
        for arrival, stamps, data in chunks:
            self._take(stamps, data, arrival, companions)
            if counter is not None:
                self._count(counter, data)
        return bool(chunks), lost

    def _take(
        self, stamps: FloatArray, data: FloatArray, arrival: float, companions: RecordedStreamWriter
    ) -> None:
        self._insist(lambda: companions.samples(stamps, data))
        self.flow.came(arrival, len(stamps))
        count = self.flow.samples
        self._insist(lambda: companions.arrival(count, arrival))
        if self.signals is not None:
            self.signals.give(stamps, data, count - len(stamps))

    def _count(self, counter: Counter, data: FloatArray) -> None:
        if missing := counter.missing(data):
            self.flow.missing += missing
            first = self.flow.samples - len(data)
            self.note(COUNTER_GAP, missing=missing, samples=[first, first + len(data)])

    def _mark_silence(self, *, came: bool) -> None:
        """Note where a regular stream falls silent, and where it goes on."""
        if self.header is None or self.header.rate_hz <= 0.0:
            return
        if self._silent and came:
            self._silent = False
            self.note("flows", sample=self.flow.samples)
        elif not self._silent and not came and _now() - self.flow.last > SILENT_S:
            self._silent = True
            self.note("silent", sample=self.flow.samples)

    def _probe(self, companions: RecordedStreamWriter) -> None:
        while not self._stop.wait(PROBE_S):
            clock = self._clock
            if clock is not None and (probe := clock.new()) is not None and clock is self._clock:
                self.flow.probe = probe
                self.flow.probes += 1
                self._insist(partial(companions.probe, probe))

    def _insist(self, write: Callable[[], object]) -> None:
        """Write, again and again while the disk is full: liblsl keeps what comes meanwhile."""
        while True:
            try:
                write()
            except RecordingError as error:
                self.flow.fault = str(error)
                if self._give_up.wait(RETRY_S):
                    return
            else:
                self.flow.fault = None
                return


def _open(info: "pylsl.StreamInfo") -> "tuple[pylsl.StreamInlet, StreamHeader]":
    """Return an inlet that receives from now on, and the full header."""
    import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

    inlet = pylsl.StreamInlet(
        info, max_buflen=BUFFER_S, recover=False, processing_flags=0, as_numpy=True
    )
    header = StreamHeader.from_xml(inlet.info(timeout=1.0).as_xml())
    inlet.open_stream(timeout=1.0)
    return inlet, header


def _now() -> float:
    return time.perf_counter()
