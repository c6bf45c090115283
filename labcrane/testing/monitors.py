"""Contract of monitors: what tells whether a stream's signal is alive."""

import time

import numpy as np

from labcrane.core.roles import SignalMonitor
from labcrane.core.signals import SignalFault, SignalStream
from labcrane.types import FloatArray

SHARE = 0.1
"""Of the time in which samples come that a monitor may take, at most: others run beside it."""


class SignalMonitorContract:
    """What every monitor must do.

    Provide the fixtures ``monitor``, ``stream``, which it knows, and ``clean``: some seconds of a
    living signal of that stream, shape ``(n, n_channels)``.
    """

    def test_monitor_finds_nothing_in_a_living_signal(
        self, monitor: SignalMonitor, stream: SignalStream, clean: FloatArray
    ) -> None:
        assert monitor.knows(stream), (
            f"knows() is not true of the stream {stream.name!r} of the fixture 'stream'; let it "
            "return True, or give a stream that the monitor is for"
        )
        monitor.begin(stream)
        found = list(monitor.look(_times(stream, clean), clean))
        assert not found, (
            f"look() found {found} in the fixture 'clean'; find nothing in a living signal, or "
            "give one that is"
        )

    def test_monitor_knows_no_stream_without_channels_or_rate(self, monitor: SignalMonitor) -> None:
        assert not monitor.knows(SignalStream("nothing", "nothing", 0.0, ())), (
            "knows() is true of a stream without channels and rate; look at the stream's type, "
            "channels and rate, and return False for what the monitor cannot judge"
        )

    def test_verdict_does_not_depend_on_how_samples_come(
        self, monitor: SignalMonitor, stream: SignalStream, clean: FloatArray
    ) -> None:
        dead = np.repeat(clean[-1:], len(clean), axis=0)
        whole = np.concatenate([clean, dead])
        times = _times(stream, whole)
        monitor.begin(stream)
        at_once = _checked(stream, monitor.look(times, whole))
        monitor.begin(stream)
        one_by_one: set[tuple[str, str]] = set()
        for at in range(len(whole)):
            faults = monitor.look(times[at : at + 1], whole[at : at + 1])
            one_by_one = _checked(stream, faults)
        assert one_by_one == at_once, (
            f"look() told {sorted(one_by_one)} at the end when samples came one by one, and "
            f"{sorted(at_once)} when all came at once; judge by the samples' times, and keep what "
            "is needed of the earlier ones"
        )

    def test_monitor_takes_whatever_a_source_may_send(
        self, monitor: SignalMonitor, stream: SignalStream, clean: FloatArray
    ) -> None:
        for value in (np.nan, np.inf, -np.inf, 0.0, 1e300):
            monitor.begin(stream)
            with np.errstate(all="ignore"):
                _checked(stream, monitor.look(_times(stream, clean), np.full(clean.shape, value)))
        monitor.begin(stream)
        _checked(stream, monitor.look(np.empty(0), clean[:0]))

    def test_monitor_forgets_when_it_begins_anew(
        self, monitor: SignalMonitor, stream: SignalStream, clean: FloatArray
    ) -> None:
        monitor.begin(stream)
        with np.errstate(all="ignore"):
            monitor.look(_times(stream, clean), np.full(clean.shape, np.nan))
        monitor.begin(stream)
        found = list(monitor.look(_times(stream, clean), clean))
        assert not found, (
            f"look() found {found} in a living signal after a bad one and begin(); let begin() "
            "forget all that came before"
        )

    def test_monitor_takes_a_tenth_of_the_time_that_the_signal_takes(
        self, monitor: SignalMonitor, stream: SignalStream, clean: FloatArray
    ) -> None:
        monitor.begin(stream)
        began = time.process_time()
        monitor.look(_times(stream, clean), clean)
        took, lasts = time.process_time() - began, len(clean) / stream.rate_hz
        assert took < SHARE * lasts, (
            f"look() took {took:.2f} s for {lasts:.1f} s of signal; it may take a tenth of it, for "
            "others run beside it: compute with whole arrays"
        )


def _times(stream: SignalStream, samples: FloatArray) -> FloatArray:
    return 100.0 + np.arange(len(samples)) / stream.rate_hz


def _checked(stream: SignalStream, faults: object) -> set[tuple[str, str]]:
    """Return the reported faults by channel, and check that each report is complete."""
    labels = {"", *(channel.label for channel in stream.channels)}
    found: set[tuple[str, str]] = set()
    assert isinstance(faults, list | tuple), f"look() must return a sequence, not {faults!r}"
    for fault in faults:
        assert isinstance(fault, SignalFault), (
            f"look() returned {fault!r}; return SignalFault(channel, kind, message)"
        )
        assert fault.channel in labels, (
            f"look() told a fault of channel {fault.channel!r}, which the stream does not have; it "
            f"has {sorted(labels - {''})}, and '' is the whole stream"
        )
        assert fault.kind, (
            f"look() told a fault without a kind: {fault}; give it a word that groups such faults"
        )
        assert fault.message, (
            f"look() told a fault without a message: {fault}; write what is seen, and what to do"
        )
        found.add((fault.channel, fault.kind))
    return found
