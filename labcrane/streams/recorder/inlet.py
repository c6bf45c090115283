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
from labcrane.streams.probes import ClockProbe, was_reset
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

    liblsl corrects nothing here: its own correction mis-stamps samples when a source restarts.

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
        self._companions: RecordedStreamWriter | None = None
        self._nothing_since: int | None = None
        """Where the source was replaced, as long as no sample of another one is known."""
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
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        inlet = pylsl.StreamInlet(
            self.info, max_buflen=BUFFER_S, recover=True, processing_flags=0, as_numpy=True
        )
        header = self._ask(inlet)
        if header is None:
            return
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
        prober = threading.Thread(
            target=self._watched,
            args=(partial(self._probe, ClockProbe(inlet), companions),),
            name=f"probe {header.name}",
            daemon=True,
        )
        self._threads.append(prober)
        prober.start()
        self._open(inlet)
        silent = False
        while True:
            stopping = self._stop.wait(PULL_S)
            came = self._pull(inlet, companions, counter)
            silent = self._mark_silence(silent=silent, came=came)
            if stopping:
                break
        prober.join()

    def _ask(self, inlet: "pylsl.StreamInlet") -> StreamHeader | None:
        """Return the full header; None when recording ends before the source tells."""
        while not self._stop.is_set():
            try:
                return StreamHeader.from_xml(inlet.info(timeout=1.0).as_xml())
            except (TimeoutError, RuntimeError):  # lost again: pylsl's LostError is a RuntimeError
                continue
            except RecordingError as error:
                self.flow.fault = str(error)
                return None
        return None

    def _open(self, inlet: "pylsl.StreamInlet") -> None:
        while not self._stop.is_set():
            try:
                inlet.open_stream(timeout=1.0)
            except (TimeoutError, RuntimeError):
                continue
            return

    def _pull(
        self, inlet: "pylsl.StreamInlet", companions: RecordedStreamWriter, counter: Counter | None
    ) -> bool:
        """Write down all that has come; whether anything had."""
        chunks = []
        while True:
            try:
                data, stamps = inlet.pull_chunk(0.0, MOST)
            except RuntimeError:  # lost, and not to be found again
                return False
            chunks.append((_now(), np.asarray(stamps), np.asarray(data)))
            if len(stamps) < MOST:
                break
        # Polled after the pull and before anything is written: the first sample of the other
        # source is among these, or will be the next.
        if reset := was_reset(inlet):
            first = self.flow.samples
            where = [first, first + sum(len(stamps) for _, stamps, _ in chunks)]
            # liblsl may try twice until it has a source: one break, when nothing came between.
            if self._nothing_since != first:
                self.flow.resets += 1
                self.flow.reset_at = _now()
                self.note(RESET, samples=where)
            self._nothing_since = first if where[0] == where[1] else None
            if counter is not None:
                counter.forget()
        for arrival, stamps, data in chunks:
            if len(stamps):
                self._take(stamps, data, arrival, companions)
                if counter is not None and not reset:
                    self._count(counter, data)
        return any(len(stamps) for _, stamps, _ in chunks)

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

    def _mark_silence(self, *, silent: bool, came: bool) -> bool:
        """Note where a regular stream falls silent, and where it goes on."""
        if self.header is None or self.header.rate_hz <= 0.0:
            return False
        if silent and came:
            self.note("flows", sample=self.flow.samples)
            return False
        if not silent and not came and _now() - self.flow.last > SILENT_S:
            self.note("silent", sample=self.flow.samples)
            return True
        return silent

    def _probe(self, clock: ClockProbe, companions: RecordedStreamWriter) -> None:
        while not self._stop.wait(PROBE_S):
            if (probe := clock.new()) is not None:
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


def _now() -> float:
    return time.perf_counter()
