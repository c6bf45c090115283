"""The estimates that come with labcrane, against signals whose values are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from labcrane import Estimate, FloatArray, StreamError
from labcrane.core import EstimateSettings, SignalChannel, SignalStream
from labcrane.testing import EstimateContract, ch8, discover
from labcrane_estimates.band_power import BandPower
from labcrane_estimates.heart import Heart
from labcrane_estimates.pupil import Pupil
from labcrane_estimates.settings import (
    BandPowerSettings,
    HeartSettings,
    PupilSettings,
    SkinSettings,
)
from labcrane_estimates.skin import Skin

RATE_HZ = 250.0
EEG = SignalStream("cap", "EEG", RATE_HZ, (SignalChannel("Fz"), SignalChannel("Pz")))
ECG = SignalStream("belt", "ECG", RATE_HZ, (SignalChannel("lead"),))
EDA = SignalStream("hand", "EDA", 50.0, (SignalChannel("palm"),))
EYE = SignalStream("eye", "Gaze", 60.0, (SignalChannel("pupil"),))
LOAD = BandPowerSettings(
    stream="eeg", fallback={"ratio": 1.0}, channels=("Fz",), per_channels=("Pz",)
)
HEART = HeartSettings(
    stream="ecg", fallback={"rate": 70.0, "rmssd": 40.0}, channel="lead", window_s=20.0
)
SKIN = SkinSettings(stream="eda", fallback={"rate": 5.0}, channel="palm")
PUPIL = PupilSettings(stream="eye", fallback={"change": 0.0}, channel="pupil", baseline_s=5.0)


def built(name: str, settings: EstimateSettings) -> Estimate:
    return discover().offers[Estimate][name].build(settings, ch8())  # type: ignore[return-value]


def eeg(theta: float, alpha: float, seconds: float = 4.0) -> FloatArray:
    """Return sines of 6 Hz at Fz and of 10 Hz at Pz, with these amplitudes."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return np.column_stack(
        [theta * np.sin(2 * np.pi * 6.0 * t), alpha * np.sin(2 * np.pi * 10.0 * t)]
    )


def ecg(beats: FloatArray, seconds: float) -> FloatArray:
    """Return an ECG of R waves of 20 ms at these times, on a slow baseline and T waves."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    since = t[:, None] - beats
    waves = np.exp(-0.5 * (since / 0.01) ** 2) + 0.25 * np.exp(-0.5 * ((since - 0.25) / 0.05) ** 2)
    return (waves.sum(axis=1) + 0.5 * np.sin(2 * np.pi * 0.2 * t))[:, None]


def eda(onsets: FloatArray, amplitudes: FloatArray, drift: float = 0.0) -> FloatArray:
    """Return a minute of conductance: responses that rise in 1.5 s and fall over 4 s, and noise."""
    t = np.arange(round(61 * EDA.rate_hz)) / EDA.rate_hz
    since = np.clip(t[:, None] - onsets, 0.0, None)
    shape = np.exp(-since / 4.0) - np.exp(-since / 0.75)
    level = 5.0 + drift * t + (shape / shape.max(axis=0, initial=1e-9) * amplitudes).sum(axis=1)
    return (level + np.random.default_rng(3).normal(0.0, 0.002, len(t)))[:, None]


def values(estimate: Estimate, stream: SignalStream, samples: FloatArray) -> tuple[float, ...]:
    estimate.begin(stream)
    found = estimate.update(100.0 + np.arange(len(samples)) / stream.rate_hz, samples)
    assert found is not None
    return found.values


class TestBandPower(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return LOAD

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("band_power", LOAD)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return EEG

    @pytest.fixture
    def clean(self) -> FloatArray:
        return eeg(20.0, 10.0)


class TestHeart(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return HEART

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("heart", HEART)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return ECG

    @pytest.fixture
    def clean(self) -> FloatArray:
        return ecg(np.arange(0.5, 25.0, 0.8), 25.0)


class TestSkin(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return SKIN

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("skin", SKIN)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return EDA

    @pytest.fixture
    def clean(self) -> FloatArray:
        return eda(np.arange(5.0, 50.0, 8.0), np.full(6, 0.3))


class TestPupil(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return PUPIL

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("pupil", PUPIL)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return EYE

    @pytest.fixture
    def clean(self) -> FloatArray:
        return np.full((600, 1), 4.0)


def test_the_ratio_is_that_of_the_amplitudes_squared() -> None:
    # One band has 4 bins of 1 Hz, the other 5: each sine is in one of them, smeared by the window.
    (ratio,) = values(BandPower(LOAD), EEG, eeg(20.0, 10.0))
    assert ratio == pytest.approx(4.0 * 5 / 4, rel=0.02)


def test_the_rate_and_rmssd_are_those_of_the_beats() -> None:
    intervals = np.where(np.arange(30) % 2, 0.78, 0.82)
    beats = 0.5 + np.cumsum(intervals)
    rate, rmssd = values(Heart(HEART), ECG, ecg(beats, 24.0))
    assert rate == pytest.approx(75.0, rel=0.01)
    assert rmssd == pytest.approx(40.0, abs=4.0)  # a sample is 4 ms


@pytest.mark.parametrize("drift", [0.1, -0.1])
@pytest.mark.parametrize("seed", range(20))
def test_the_rate_of_responses_is_that_of_those_that_are_large_enough(
    seed: int, drift: float
) -> None:
    """Also while the level drifts by up to 6 uS in the minute: more than any response falls."""
    draw = np.random.default_rng(seed)
    onsets = 4.0 + np.cumsum(draw.uniform(6.0, 9.0, 6))
    amplitudes = draw.choice([0.01, 0.15, 0.6], 6)
    samples = eda(onsets, amplitudes, drift=drift * draw.uniform())
    (rate,) = values(Skin(SKIN), EDA, samples)
    assert rate == np.count_nonzero(amplitudes > 0.1)


def test_a_pupil_that_grows_by_a_tenth_has_a_change_of_a_tenth_and_blinks_are_left_out() -> None:
    size = np.full((600, 1), 4.0)
    size[540:] = 4.4
    size[550:560] = 0.0
    (change,) = values(Pupil(PUPIL), EYE, size)
    assert change == pytest.approx(0.1, abs=1e-9)
    size[530:] = 0.0
    assert math.isnan(values(Pupil(PUPIL), EYE, size)[0])


def test_missing_samples_give_no_number() -> None:
    samples = eeg(20.0, 10.0)
    times = 100.0 + np.arange(len(samples)) / RATE_HZ
    keep = np.r_[0:700, 900:1000]
    load = BandPower(LOAD)
    load.begin(EEG)
    found = load.update(times[keep], samples[keep])
    assert found is not None
    assert math.isnan(found.values[0])


def test_a_window_begins_anew_where_times_go_back() -> None:
    samples = eeg(20.0, 10.0)
    times = 100.0 + np.arange(len(samples)) / RATE_HZ
    load = BandPower(LOAD)
    load.begin(EEG)
    assert load.update(times, samples) is not None
    assert load.update(times[:250] - 50.0, samples[:250]) is None
    found = load.update(times[250:510] - 50.0, samples[250:510])
    assert found is not None
    assert 50.0 <= found.first < 51.0


@pytest.mark.parametrize(("settings", "slow"), [(SKIN, 2.0), (HEART, 40.0)])
def test_a_stream_that_is_too_slow_for_its_signal_is_refused_with_the_rate_that_is_needed(
    settings: EstimateSettings, slow: float
) -> None:
    name, at = ("skin", EDA) if settings is SKIN else ("heart", ECG)
    estimate = built(name, settings)
    with pytest.raises(StreamError, match=f"give a stream of more than {slow:g} Hz"):
        estimate.begin(replace(at, rate_hz=slow))
    fast = replace(at, rate_hz=slow + 1.0)
    shortest = settings.model_copy(update={"window_s": 10.0 if settings is SKIN else 5.0})
    assert len(values(built(name, shortest), fast, np.zeros((600, 1)))) == len(settings.values)


@pytest.mark.parametrize("settings", [SKIN, HEART])
def test_a_window_in_which_no_value_can_be_is_refused(settings: EstimateSettings) -> None:
    with pytest.raises(ValidationError, match="greater than or equal to"):
        type(settings).model_validate({**settings.model_dump(), "window_s": 4.9})


def test_a_channel_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(StreamError, match="no channel Fz, Pz; it has lead"):
        BandPower(LOAD).begin(ECG)
