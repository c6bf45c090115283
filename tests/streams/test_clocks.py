"""Real processes with wrong clocks, recorded by the real recorder: the short version.

The whole table, with long runs and a busy computer, is ``python -m benchmarks.sync``.
"""

import time

import numpy as np
import pytest
from needs import need
from streams.emulation import (
    Lab,
    Skew,
    alignment,
    build,
    load,
    stop,
    truth,
    until,
    until_ready,
)

from labcrane.streams.sync.correction import Treatment, correct
from labcrane.streams.sync.dejitter import Dejitter
from labcrane.streams.sync.raw import raw_of
from labcrane.streams.sync.resync import resync

pytestmark = pytest.mark.quiet  # how right stamps are shows the computer too

EXACT = Treatment(rate_hz=1000.0)
CHUNKS = Treatment(rate_hz=1000.0, dejitter=Dejitter.ENVELOPE, transport_s=0.008)

SECONDS = 22.0


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    need("gcc")
    return build(tmp_path_factory.mktemp("skew"))


@pytest.fixture(scope="module")
def recorded(library, tmp_path_factory):
    """One recording of four devices and a marker program; one of the devices is replaced."""
    lab = Lab(tmp_path_factory.mktemp("clocks"), library)
    try:
        lab.device("Drifting", Skew())
        lab.device("Stepping", Skew(step=0.3, step_after=12.0))
        lab.device("Chunks", Skew(mode="chunk"))
        first = lab.device("Restarted", Skew())
        lab.markers()
        recorder = lab.recorder(
            *({"label": kind, "type": kind, "several": True} for kind in ("EEG", "Markers"))
        )
        until(recorder, lambda status: status["ready"] and len(status["streams"]) == 5)
        begin = time.monotonic()
        time.sleep(SECONDS / 3)
        first.kill()
        first.wait()
        lab.device("Restarted", Skew(offset=5000.0, ppm=-100.0))
        until_ready(recorder)
        time.sleep(max(SECONDS - (time.monotonic() - begin), 5.0))
        assert stop(recorder) == 0
    finally:
        lab.close()
    return lab


def held_up_ms(*corrected):
    """Return by how much the probes may err that waited for a busy computer: half as long."""
    qualities = [one.quality for one in corrected]
    return sum(1e3 * (each.rtt_p95_s / 2.0 - each.hidden_s) for each in qualities)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "treatment", "limit_ms"),
    [("Drifting", EXACT, 0.05), ("Stepping", EXACT, 0.05), ("Chunks", CHUNKS, 0.3)],
)
def test_markers_fall_on_the_right_samples(recorded, name, treatment, limit_ms):
    """Wider limits than those of the whole table: the run is short and the computer is shared.

    What is right depends on the probes: by as much as they were held up nobody can know better.
    """
    streams = recorded.streams()
    device, markers = streams[name], streams["Moments"]
    samples, moments = correct(raw_of(device), treatment), resync(markers)
    error = alignment(truth(device), samples.time, truth(markers), moments.time)
    assert len(error) > 20
    bound = limit_ms + held_up_ms(samples, moments)
    assert 1e3 * np.quantile(np.abs(error), 0.95) < bound


@pytest.mark.slow
def test_no_sample_of_a_replaced_source_is_mis_stamped(recorded):
    device = recorded.streams()["Restarted"]
    corrected = resync(device)
    assert len(corrected.segments) == 2
    assert device.time_raw.max() - device.time_raw.min() > 3900.0  # the clocks were 4000 s apart
    assert np.abs(corrected.time - truth(device)).max() < 5e-4


@pytest.mark.slow
def test_the_sources_clock_is_known(recorded):
    streams = recorded.streams()
    corrected = resync(streams["Drifting"])
    drift = corrected.quality
    bound = 5.0 + 1e3 * held_up_ms(corrected) / SECONDS
    assert drift.drift_ppm == pytest.approx(100.0, abs=bound)
    assert 0.0 <= drift.probe_age_s < SECONDS
    assert drift.unprobed == drift.unsure == drift.gaps == 0
    moments = resync(streams["Moments"])
    bound = 5.0 + 1e3 * held_up_ms(moments) / SECONDS
    assert moments.quality.drift_ppm == pytest.approx(0.0, abs=bound)


@pytest.mark.slow
def test_pyxdf_reads_the_same_journal_to_the_same_times(recorded):
    """An independent reader, where a straight line is right: a steady clock."""
    device = recorded.streams()["Drifting"]
    theirs = load(recorded.journal)["Drifting"]
    np.testing.assert_array_equal(theirs["time_series"], device.data)
    ours = correct(raw_of(device), EXACT)
    apart = 1e3 * np.abs(theirs["time_stamps"] - ours.time)
    assert apart.max() < 0.05 + held_up_ms(ours)
    raw = load(recorded.journal, synchronize_clocks=False, dejitter_timestamps=False)["Drifting"]
    np.testing.assert_array_equal(raw["time_stamps"], device.time_raw)
