"""The process of one estimate.

It is started by a :class:`labcrane.processes.handle.ProcessHandle` with a
:class:`labcrane.session.part.PartConfig` and ends when its parent does. It is told which
stream the recorder has, by the properties of its description, and receives it by an inlet of its
own. It reports the stream of its values (``sends``), that it lives (``beat``), and the reason for
which it ends (``failed``).
"""

import math
import sys
import time
from collections.abc import Mapping

import numpy as np

from labcrane.core.records import Estimated
from labcrane.core.roles import Estimate
from labcrane.core.settings import EstimateSettings
from labcrane.errors import StreamError
from labcrane.monitoring.monitored_stream import signal_stream
from labcrane.processes.parent import Parent, serve
from labcrane.protocol.estimated import State
from labcrane.protocol.streams import StreamNeed
from labcrane.recording.own_streams import ESTIMATED, STATED
from labcrane.recording.xdf.header import StreamHeader
from labcrane.session.part import PartConfig
from labcrane.streams.newest import NewestSample
from labcrane.streams.outlets import SampleOutlet, channel, check_clock, stream_info
from labcrane.streams.probes import Probe
from labcrane.types import FloatArray

PULL_S = 0.01
BEAT_S = 0.5
ANSWER_S = 1.0
DRIFT = 1e-4
"""How far a crystal in order drifts beyond what was measured last, as a share of the time."""


def run(config: PartConfig, parent: Parent) -> None:
    """Estimate until the parent is gone; raises what the estimate raises."""
    study = config.load()
    choice = study.choices[f"estimates.{config.name}"]
    estimate, settings = choice.build(study.machine), study.estimates[config.name]
    assert isinstance(estimate, Estimate)  # noqa: S101 - an offer of this role
    check_clock()
    outlet = _Outlet(config, settings)
    parent.tell({"sends": outlet.description})
    need = study.protocol.streams[settings.stream]
    source: _Source | None = None
    beaten = came = 0.0
    try:
        while not parent.gone.is_set():
            parent.wait(PULL_S)
            for wanted in parent.messages():
                if source is not None:
                    source.close()
                source = _Source(wanted, need, estimate)
            now = time.perf_counter()
            if source is not None and len((new := source.new())[0]):
                came = now
                outlet.push(*new, estimate, source.error_s)
            if now - beaten >= BEAT_S:
                beaten = now
                parent.tell({"beat": True})
                if now - came > settings.at_most_age_s:
                    outlet.push_nothing(now)
    finally:
        if source is not None:
            source.close()
        estimate.close()


class _Source:
    """The stream that an estimate is computed from, on our clock as far as that is known.

    Attributes
    ----------
    error_s
        By how much times may be off: half of the round trip in which the source's clock was
        measured, and what it may have drifted since, by its last two measurements.
    """

    def __init__(self, wanted: Mapping[str, str], need: StreamNeed, estimate: Estimate) -> None:
        self._stream = NewestSample(wanted)
        self._need, self._estimate = need, estimate
        self._uid = ""
        self._latency_s = self.error_s = 0.0
        self._clock: Probe | None = None
        self._drift = DRIFT

    def new(self) -> tuple[FloatArray, FloatArray]:
        """Return times and samples that have come since the last call."""
        samples, stamps = self._stream.pull()
        info = self._stream.info
        nothing = np.empty(0), np.empty((0, 0))
        if not stamps or info is None:
            return nothing
        if info.uid() != self._uid:
            header = StreamHeader.from_xml(info.as_xml())
            self._estimate.begin(signal_stream(header))
            self._latency_s = self._need.treatment(header).latency_s
        try:
            clock = self._stream.clock(ANSWER_S)
        except StreamError:
            return nothing  # times would be of another clock
        if info.uid() != self._uid:
            self._uid = info.uid()
            return nothing  # the first answer about the clock takes a while: these are late
        if (last := self._clock) is not None and clock.remote_time > last.remote_time:
            drifted = abs(clock.offset - last.offset) / (clock.remote_time - last.remote_time)
            self._drift = DRIFT + drifted
        self._clock = clock
        since = time.perf_counter() - (clock.remote_time + clock.offset)
        self.error_s = clock.rtt / 2.0 + self._drift * since
        return np.array(stamps) + (clock.offset - self._latency_s), np.array(samples, np.float64)

    def close(self) -> None:
        self._stream.close()


class _Outlet:
    """The stream of an estimate: values, first and last sample, and state, at the values' time."""

    def __init__(self, config: PartConfig, settings: EstimateSettings) -> None:
        columns = (*settings.values, "first", "last", *STATED, "state")
        self._size = len(settings.values)
        name = ESTIMATED + config.name
        info = stream_info(
            name, "Estimate", len(columns), "double64", rate_hz=0.0, source=config.source
        )
        for label in columns:
            unit = "seconds" if label in {"first", "last", *STATED} else "none"
            channel(info, label=label, unit=unit, type="Estimate")
        self._outlet = SampleOutlet(info, len(columns))
        self._newest: Estimated | None = None

    @property
    def description(self) -> str:
        """The stream as XML."""
        return self._outlet.description

    def push(
        self, times: FloatArray, samples: FloatArray, estimate: Estimate, error_s: float
    ) -> None:
        """Send what an estimate computes from its next samples, whose times may be off so far."""
        with np.errstate(all="ignore"):  # sources send whatever they like
            found = estimate.update(times, samples)
        last = float(times[-1])
        if found is None:
            self._send(np.full(self._size, np.nan), last, (math.nan, last), State.WARMING_UP)
            return
        if found == self._newest:
            return  # nothing new was computed
        self._newest = found
        values = np.array(found.values)
        state = State.OK if np.isfinite(values).all() else State.NOT_A_NUMBER
        self._send(values, found.time, (found.first, last), state, error_s)

    def push_nothing(self, now: float) -> None:
        """Send that no data come."""
        self._send(np.full(self._size, np.nan), now, (math.nan, math.nan), State.NO_DATA)

    def _send(
        self,
        values: FloatArray,
        stamp: float,
        seen: tuple[float, float],
        state: State,
        error_s: float = 0.0,
    ) -> None:
        self._outlet.push(np.array([*values, *seen, error_s, state]), stamp)


if __name__ == "__main__":
    sys.exit(serve(run))
