"""Sixteen unkind devices, each a process of its own with real outlets, and the real recorder.

All at once, in one recording. Their truth is in their first channel; nothing else knows it.
"""

import signal
import time
from dataclasses import dataclass

import numpy as np
import pytest
from needs import need
from streams.emulation import Lab, Skew, build, stop, truth, until

from labcrane.core import Verdict
from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.dejitter import Dejitter
from labcrane.streams.sync.raw import raw_of
from labcrane.streams.sync.report.certificate import Fault, faults
from labcrane.streams.sync.report.limits import Limits
from labcrane.streams.sync.report.stream_report import judge_stream

pytestmark = [pytest.mark.soak, pytest.mark.quiet, pytest.mark.xdist_group("real devices")]

SECONDS = 52.0
TURN = 15.0
"""After a device has begun; clocks change later, counted from when it is started."""

ASLEEP_S = 6.0
RATE = 250.0
EXACT = Treatment(RATE)
CHUNKS = Treatment(RATE, dejitter=Dejitter.ENVELOPE, transport_s=0.008)

BY_LOAD = {Fault.CONGESTED, Fault.STALLED}
"""What the computer that emulates may do itself, and may be named everywhere."""


@dataclass(frozen=True)
class Device:
    """A device, what is wrong with it, and its largest error at 95 %, in milliseconds."""

    skew: Skew
    faults: frozenset[Fault] = frozenset()
    limit_ms: float | None = 0.1
    treatment: Treatment = EXACT


def a_device(mode="exact", *wrong, limit_ms=0.1, treatment=EXACT, **skew):
    return Device(Skew(mode=mode, **skew), frozenset(wrong), limit_ms, treatment)


DEVICES = {
    "steady": a_device(),
    "wandering": a_device(wander=0.001),
    "stepping": a_device("exact", Fault.STEPPED, step=0.3, step_after=25.0),
    "stepping back": a_device("exact", Fault.STEPPED, step=-0.7, step_after=27.0),
    "slewed": a_device("exact", Fault.SLEWED, slew=2e-3, slew_after=22.0, slew_s=12.0),
    "asleep": a_device("exact", Fault.SLEPT, Fault.INTERRUPTED, step=-ASLEEP_S, step_after=25.0),
    "answering late": a_device(reply=0.002, limit_ms=None),
    "losing samples": a_device("lost", Fault.LOST),
    "uneven": a_device("uneven"),
    "stalling": a_device("stalling", Fault.STALLED),
    "out of order": a_device("shuffled", Fault.DISORDERED),
    "changing its rate": a_device("changing", Fault.CHANGED_RATE),
    "with our clock": a_device("receiver", Fault.RECEIVER, limit_ms=None, offset=0.3),
    "with another clock": a_device("foreign", Fault.FOREIGN, limit_ms=None),
    "dying": a_device("dying", Fault.DIED),
    "stamping when it sends": a_device("chunk", Fault.LATE_STAMPS, limit_ms=None, treatment=CHUNKS),
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    need("gcc")
    lab = Lab(tmp_path_factory.mktemp("devices"), build(tmp_path_factory.mktemp("skew")))
    try:
        began = time.perf_counter()
        started = {
            name: lab.device(name, one.skew, rate=RATE, size=25, turn_s=TURN)
            for name, one in DEVICES.items()
        }
        recorder = lab.recorder({"label": "EEG", "type": "EEG", "several": True})
        until(recorder, lambda status: len(status["streams"]) == len(DEVICES))
        # Its clock stands still for as long as it does: the step lies within, when nobody reads it.
        falls = began + DEVICES["asleep"].skew.step_after - 2.0
        assert time.perf_counter() < falls, "sixteen devices took too long to start"
        time.sleep(falls - time.perf_counter())
        started["asleep"].send_signal(signal.SIGSTOP)
        time.sleep(ASLEEP_S)
        started["asleep"].send_signal(signal.SIGCONT)
        time.sleep(max(began + SECONDS - time.perf_counter(), 5.0))
        ended = time.perf_counter()
        assert stop(recorder) == 0
    finally:
        lab.close()
    return lab.streams(), ended


def judged(recorded, name):
    """Return a device's corrected times, its true ones, its faults and its verdict."""
    streams, ended = recorded
    device, stream = DEVICES[name], streams[name]
    corrected = correct(raw_of(stream), device.treatment, ended)
    report = judge_stream(stream, corrected.quality, Limits())
    return corrected, truth(stream), faults(corrected.quality, RATE), report.verdict


@pytest.mark.parametrize("name", DEVICES)
def test_a_real_device_is_as_right_as_it_is_said_to_be(recorded, name, record_property):
    device = DEVICES[name]
    corrected, true, named, verdict = judged(recorded, name)
    error = 1e3 * np.abs(corrected.time - true)
    p95, cover = float(np.quantile(error, 0.95)), float(np.mean(error <= 1e3 * corrected.error))
    record_property("largest error, ms", float(error.max()))
    record_property("95 % of errors are below, ms", p95)
    record_property("share of errors above the stated one", 1.0 - cover)
    assert len(error) > 1000
    assert cover >= 0.95
    if device.limit_ms is not None:
        assert p95 <= device.limit_ms
    assert verdict is not Verdict.PASS or error.max() <= 1.0
    assert named - BY_LOAD == device.faults - BY_LOAD
    assert device.faults <= named
