"""Monitoring of streams before a session: how each arrives, and whether its signal is alive."""

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from labcrane.core.signals import SignalFault, SignalStream
from labcrane.errors import LabcraneError, RecordingError
from labcrane.monitoring.config import MonitorBuilder
from labcrane.monitoring.monitored_stream import MonitoredStream, signal_stream
from labcrane.monitoring.stream_meter import StreamMeter, StreamReading
from labcrane.recording.xdf.header import StreamHeader
from labcrane.streams.probes import ClockProbe
from labcrane.streams.recorder.health import Counter

if TYPE_CHECKING:
    import pylsl

PULL_S = 0.005
PROBE_S = 0.5
ANSWER_S = 2.0
BUFFER_S = 10
MOST = 8192
END_S = 3.0


@dataclass(frozen=True, slots=True)
class StreamView:
    """Present state of a stream.

    Attributes
    ----------
    name, host
        As LSL has them.
    stream
        What its header states; None while it does not answer.
    reading
        How it comes.
    faults
        Faults of its signal.
    watched
        Whether any monitor knows it.
    trouble
        Why it, or a monitor, cannot be looked at; empty while all is well.
    """

    name: str
    host: str
    stream: SignalStream | None
    reading: StreamReading
    faults: tuple[SignalFault, ...]
    watched: bool
    trouble: tuple[str, ...]


class WatchedInlet:
    """One stream that is looked at, in threads of its own, and not recorded."""

    def __init__(self, info: "pylsl.StreamInfo", builder: MonitorBuilder) -> None:
        self._info = info
        self._builder = builder
        self._meter = StreamMeter(info.nominal_srate())
        self._signals: MonitoredStream | None = None
        self._stream: SignalStream | None = None
        self._trouble: list[str] = []
        self._stop = threading.Event()
        name = f"watch {info.name()}"
        self._threads = [threading.Thread(target=self._receive, name=name, daemon=True)]
        self._threads[0].start()

    def view(self) -> StreamView:
        """Return its present state."""
        signals = self._signals
        failed = signals.failed if signals else {}
        trouble = [*self._trouble, *(f"monitor {name!r}: {why}" for name, why in failed.items())]
        return StreamView(
            self._info.name(),
            self._info.hostname(),
            self._stream,
            self._meter.reading(time.perf_counter()),
            signals.faults if signals else (),
            signals is not None and signals.watched,
            tuple(trouble),
        )

    def close(self) -> None:
        """Look no more, and let go of the stream."""
        self._stop.set()
        for thread in self._threads:
            thread.join(END_S)

    def _receive(self) -> None:
        import pylsl  # noqa: PLC0415 - liblsl reads its configuration when it is loaded

        inlet = pylsl.StreamInlet(
            self._info, max_buflen=BUFFER_S, recover=True, processing_flags=0, as_numpy=True
        )
        try:
            header = StreamHeader.from_xml(inlet.info(timeout=ANSWER_S).as_xml())
        except (TimeoutError, RuntimeError, RecordingError) as error:  # RuntimeError: LostError
            self._trouble.append(f"does not send its description: {error}")
            return
        self._stream = signal_stream(header)
        if header.dtype is not None:
            self._begin(self._stream)
        probe = partial(self._probe, ClockProbe(inlet))
        self._threads.append(threading.Thread(target=probe, daemon=True))
        self._threads[-1].start()
        counter = Counter.of(header, None)
        while not self._stop.wait(PULL_S):
            try:
                data, stamps = inlet.pull_chunk(0.0, MOST)
            except RuntimeError:  # lost, and not to be found again
                self._trouble.append("is gone: restart its program")
                return
            if len(stamps):
                self._take(np.asarray(data), np.asarray(stamps), counter)

    def _begin(self, stream: SignalStream) -> None:
        try:
            self._signals = MonitoredStream(stream, self._builder.build(stream))
        except (LabcraneError, ValueError, ArithmeticError, LookupError, TypeError) as error:
            self._trouble.append(f"its signal is not monitored: {error}")

    def _take(
        self,
        data: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]",
        stamps: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]",
        counter: Counter | None,
    ) -> None:
        missing = None if counter is None else counter.missing(data)
        self._meter.take(time.perf_counter(), stamps, missing)
        if self._signals is not None:
            self._signals.look(stamps, data.astype(np.float64))

    def _probe(self, clock: ClockProbe) -> None:
        while not self._stop.wait(PROBE_S):
            if (probe := clock.new()) is not None:
                self._meter.probe(probe)


class StreamWatch:
    """All streams that were found, looked at together."""

    def __init__(self, infos: "Sequence[pylsl.StreamInfo]", builder: MonitorBuilder) -> None:
        ordered = sorted(infos, key=lambda info: (info.name(), info.hostname(), info.uid()))
        self._inlets = [WatchedInlet(info, builder) for info in ordered]

    def views(self) -> list[StreamView]:
        """Return the present state of each, by name."""
        return [inlet.view() for inlet in self._inlets]

    def close(self) -> None:
        """Let go of all streams."""
        for inlet in self._inlets:
            inlet.close()
