"""Whether a stream is well, from what has come of it."""

from dataclasses import replace

import numpy as np
import pytest

from labcrane.recording import Channel, StreamHeader
from labcrane.streams.recorder.health import (
    Condition,
    Counter,
    Flow,
    Health,
    complaints,
    condition,
    rate,
)

EEG = StreamHeader("EEG", "EEG", (Channel("Cz"), Channel("Sample Counter")), rate_hz=500.0)
MARKS = StreamHeader("Marks", "Markers", (Channel("mark"),), "string")

WELL = Health(
    label="EEG",
    name="EEG",
    type="EEG",
    source_id="amp-1",
    host="lab",
    required=True,
    condition=Condition.FLOWS,
    samples=5000,
    rate_hz=500.0,
    nominal_hz=500.0,
    channels=2,
    silent_s=0.02,
    offset_s=12.0,
    offset_age_s=1.0,
    rtt_s=0.0002,
    missing=0,
    resets=0,
)


def flow(until, chunk=10, every=0.02):
    flow = Flow()
    for number in range(round(until / every)):
        flow.came(number * every, chunk)
    return flow


@pytest.mark.slow
def test_the_rate_is_that_of_the_last_seconds():
    assert rate(flow(20.0), 20.0) == pytest.approx(500.0)
    assert rate(Flow(), 20.0) is None
    assert rate(flow(20.0), 40.0) is None
    assert len(flow(600.0).arrivals) <= 502


def test_a_regular_stream_is_silent_after_a_second_and_markers_never_are():
    assert condition(flow(10.0), EEG, 10.5) is Condition.FLOWS
    assert condition(flow(10.0), EEG, 11.1) is Condition.SILENT
    assert condition(flow(10.0), MARKS, 500.0) is Condition.FLOWS
    assert condition(Flow(), EEG, 500.0) is Condition.EMPTY
    assert condition(Flow(), None, 500.0) is Condition.OPENING


def test_a_counter_tells_what_is_missing_within_and_between_chunks():
    counter = Counter.of(EEG, None)

    def count(*numbers):
        return counter.missing(np.column_stack([np.zeros(len(numbers)), numbers]))

    assert count(7, 8, 9) == 0
    assert count(10, 13, 14) == 2
    assert count(16, 17) == 1
    assert count(0, 1) == 0  # wrapped
    counter.forget()
    assert count(1000, 1001) == 0
    assert Counter.of(MARKS, None) is None
    assert Counter.of(EEG, "Cz") is not None


def test_a_well_stream_gives_no_cause_to_complain():
    assert complaints(WELL) == []
    assert WELL.sane


@pytest.mark.parametrize(
    ("change", "text", "sane"),
    [
        ({"condition": Condition.SILENT, "silent_s": 3.0}, "silent for 3.0 s", False),
        ({"condition": Condition.EMPTY, "samples": 0}, "sent no sample", False),
        ({"rate_hz": 400.0}, "400.0 Hz instead of 500 Hz", True),
        ({"offset_age_s": 7.0}, "not answered a clock probe for 7 s", False),
        ({"rtt_s": 0.05}, "in 50.0 ms", True),
        ({"missing": 4}, "lost 4 samples", True),
    ],
)
def test_what_is_wrong_is_said(change, text, sane):
    health = replace(WELL, **change)
    (said,) = complaints(health)
    assert text in said
    assert health.sane is sane


def test_a_stream_that_is_not_what_was_expected_is_not_sane():
    assert not replace(WELL, misfits=["has 2 channels; 64 are expected"]).sane


def test_markers_may_be_waited_for_without_a_sample():
    waiting = replace(WELL, nominal_hz=0.0, condition=Condition.EMPTY, samples=0, rate_hz=None)
    assert waiting.sane
    assert complaints(waiting) == []
    assert not replace(waiting, offset_age_s=None).sane
