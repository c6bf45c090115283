"""Contract of estimates: what computes values from a stream while a session runs."""

import time

import numpy as np

from labcrane.core.records import Estimated
from labcrane.core.roles import Estimate
from labcrane.core.settings import EstimateSettings
from labcrane.core.signals import SignalStream
from labcrane.types import FloatArray

SHARE = 0.25
"""Of the time in which samples come that an estimate may take, at most: others run beside it."""

CHUNK_S = 0.05
START_S = 100.0


class EstimateContract:
    """What every estimate must do.

    Provide the fixtures ``estimate``, its ``settings``, ``stream``, and ``clean``: a signal of that
    stream, shape ``(n, n_channels)``, long enough for a value.
    """

    def test_its_settings_name_its_values(self, settings: EstimateSettings) -> None:
        assert settings.values, (
            f"{type(settings).__name__}.values is empty; name what update() returns"
        )
        assert not {"time", "state"} & set(settings.values), (
            f"the values are {settings.values}; 'time' and 'state' are columns of every estimate"
        )

    def test_a_living_signal_gives_values_of_a_time_in_it(
        self,
        estimate: Estimate,
        settings: EstimateSettings,
        stream: SignalStream,
        clean: FloatArray,
    ) -> None:
        found = _in_chunks(estimate, stream, clean)
        assert found is not None, (
            "update() returned None for all of the fixture 'clean'; give a longer signal"
        )
        assert len(found.values) == len(settings.values), (
            f"update() returned {found.values}, and the settings name {settings.values}"
        )
        assert np.isfinite(found.values).all(), f"update() returned {found.values} for 'clean'"
        last = START_S + (len(clean) - 1) / stream.rate_hz
        assert START_S <= found.first <= found.time <= last, (
            f"the values stand for {found.time} s, from {found.first} s on, and the samples last "
            f"from {START_S} s to {last} s; keep first <= time <= the newest sample"
        )

    def test_it_forgets_when_it_begins_anew(
        self, estimate: Estimate, stream: SignalStream, clean: FloatArray
    ) -> None:
        once = _in_chunks(estimate, stream, clean)
        with np.errstate(all="ignore"):
            _in_chunks(estimate, stream, np.full(clean.shape, np.nan))
        assert _in_chunks(estimate, stream, clean) == once, (
            "update() returned other values after another signal and begin(); let begin() forget"
        )

    def test_it_takes_whatever_a_source_may_send(
        self, estimate: Estimate, stream: SignalStream, clean: FloatArray
    ) -> None:
        for value in (np.nan, np.inf, 0.0, 1e300):
            with np.errstate(all="ignore"):
                _in_chunks(estimate, stream, np.full(clean.shape, value))

    def test_it_takes_a_quarter_of_the_time_that_the_signal_takes(
        self, estimate: Estimate, stream: SignalStream, clean: FloatArray
    ) -> None:
        began = time.process_time()
        _in_chunks(estimate, stream, clean)
        took, lasts = time.process_time() - began, len(clean) / stream.rate_hz
        assert took < SHARE * lasts, (
            f"update() took {took:.2f} s for {lasts:.1f} s of signal in pieces of {CHUNK_S} s; it "
            "may take a quarter of it, for others run beside it"
        )


def _in_chunks(estimate: Estimate, stream: SignalStream, samples: FloatArray) -> Estimated | None:
    """Return the last values of a signal that comes in pieces, as from an amplifier."""
    estimate.begin(stream)
    times = START_S + np.arange(len(samples)) / stream.rate_hz
    size = max(1, round(CHUNK_S * stream.rate_hz))
    found = None
    for at in range(0, len(samples), size):
        found = estimate.update(times[at : at + size], samples[at : at + size])
    return found
