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
from labcrane_estimates.drt_response import DrtResponse
from labcrane_estimates.gaze_region import GazeRegion
from labcrane_estimates.heart import Heart
from labcrane_estimates.pupil import Pupil
from labcrane_estimates.settings import (
    BandPowerSettings,
    DrtResponseSettings,
    GazeRegionSettings,
    HeartSettings,
    PupilSettings,
    SkinSettings,
    StickActivitySettings,
)
from labcrane_estimates.skin import Skin
from labcrane_estimates.stick_activity import StickActivity

RATE_HZ = 250.0
EEG = SignalStream("cap", "EEG", RATE_HZ, (SignalChannel("Fz"), SignalChannel("Pz")))
ECG = SignalStream("belt", "ECG", RATE_HZ, (SignalChannel("lead"),))
EDA = SignalStream("hand", "EDA", 50.0, (SignalChannel("palm"),))
EYE = SignalStream("eye", "Gaze", 60.0, (SignalChannel("pupil"),))
GAZE = SignalStream("eye", "Gaze", 60.0, (SignalChannel("x"), SignalChannel("y")))
STICKS = SignalStream(
    "labcrane.input", "Joystick", 240.0, (SignalChannel("left.x"), SignalChannel("left.y"))
)
CODES = SignalStream("labcrane.codes", "Markers", 0.0, (SignalChannel("code"),))
LOAD = BandPowerSettings(
    stream="eeg", fallback={"ratio": 1.0}, channels=("Fz",), per_channels=("Pz",)
)
HEART = HeartSettings(
    stream="ecg", fallback={"rate": 70.0, "rmssd": 40.0}, channel="lead", window_s=20.0
)
SKIN = SkinSettings(stream="eda", fallback={"rate": 5.0}, channel="palm")
PUPIL = PupilSettings(stream="eye", fallback={"change": 0.0}, channel="pupil", baseline_s=5.0)

REGION = GazeRegionSettings(
    stream="eye", fallback={"share": 0.5}, channels=("x", "y"), between_x=(0.4, 0.6),
    between_y=(0.0, 0.5),
)  # fmt: skip
HANDS = StickActivitySettings(
    stream="sticks", fallback={"rms_speed": 0.0, "moving": 0.0}, channels=("left.x", "left.y")
)
ANSWERS = DrtResponseSettings(stream="codes", fallback={"response_time": 0.5}, hit_s=(0.1, 2.55))


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


class TestGazeRegion(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return REGION

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("gaze_region", REGION)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return GAZE

    @pytest.fixture
    def clean(self) -> FloatArray:
        return np.full((720, 2), 0.5)


class TestStickActivity(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return HANDS

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("stick_activity", HANDS)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return STICKS

    @pytest.fixture
    def clean(self) -> FloatArray:
        return np.full((2640, 2), 0.1)


class TestDrtResponse(EstimateContract):
    @pytest.fixture
    def settings(self) -> EstimateSettings:
        return ANSWERS

    @pytest.fixture
    def estimate(self) -> Estimate:
        return built("drt_response", ANSWERS)

    @pytest.fixture
    def stream(self) -> SignalStream:
        """Return the stream as if it had a sample each tenth of a second; it has no rate."""
        return replace(CODES, rate_hz=10.0)

    @pytest.fixture
    def clean(self) -> FloatArray:
        codes = np.ones((100, 1))
        codes[[10, 15, 36], 0] = 112, 113, 114
        return codes


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


@pytest.mark.parametrize("seed", range(20))
def test_the_share_of_the_gaze_is_that_of_the_samples_drawn_within_the_rectangle(seed: int) -> None:
    draw = np.random.default_rng(seed)
    inside = draw.random(660) < draw.random()
    x = np.where(inside, draw.uniform(0.4, 0.6, 660), draw.choice([0.2, 0.39, 0.61, 1.4], 660))
    y = draw.uniform(0.0, 0.5, 660)
    x[seen := draw.random(660) < 0.1] = math.nan
    (share,) = values(GazeRegion(REGION), GAZE, np.column_stack([x, y]))
    assert share == pytest.approx(inside[60:][~seen[60:]].mean())
    (nothing,) = values(GazeRegion(REGION), GAZE, np.full((660, 2), math.nan))
    assert math.isnan(nothing)


def test_two_sines_of_the_sticks_have_the_speed_and_the_share_of_a_closed_form() -> None:
    t, step = np.arange(2640) / STICKS.rate_hz, HANDS.step_s
    hertz, size = np.array([0.5, 1.3]), np.array([0.5, 0.3])
    largest = 2.0 * size * np.sin(np.pi * hertz * step) / step  # speed of a sine over a step
    axes = size * np.sin(2.0 * np.pi * hertz * t[:, None])
    speed, _ = values(StickActivity(HANDS), STICKS, axes)
    assert speed == pytest.approx(np.sqrt((largest**2 / 2.0).sum()), rel=0.01)
    axes[:, 1] = 0.7  # held, but still
    _, moving = values(StickActivity(HANDS), STICKS, axes)
    assert moving == pytest.approx(
        1.0 - 2.0 / np.pi * np.arcsin(HANDS.still / largest[0]), abs=0.01
    )


def test_a_stick_that_creeps_by_one_position_at_a_time_is_at_rest() -> None:
    creeping = np.round(0.04 * np.arange(2640) / STICKS.rate_hz * 128.0) / 128.0
    _, moving = values(StickActivity(HANDS), STICKS, np.column_stack([creeping, creeping]))
    assert moving == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_the_response_time_is_the_mean_of_the_hits_drawn_in_the_window(seed: int) -> None:
    """Stimuli that are missed, answered too early, or ended by a pause do not count."""
    draw = np.random.default_rng(seed)
    events, hits, onset = [], [], 1000.0
    for _ in range(40):
        kind = draw.choice(["hit", "miss", "cheat", "held"], p=[0.7, 0.1, 0.1, 0.1])
        answer = {"hit": draw.uniform(0.1, 1.9), "cheat": 0.06, "held": 0.4}.get(kind, math.nan)
        decided = draw.choice([1.2, 2.9]) if kind == "held" else 2.55 + 1 / 240
        events += [(onset, 112.0), (onset + answer, 113.0), (onset + 0.01, 20.0)]
        events += [(onset + 2.0, 113.0)] * (kind in {"hit", "cheat"})  # only the first one counts
        events += [(onset + decided, 114.0)]
        hits += [(onset, answer)] * (kind == "hit")
        onset += draw.uniform(3.0, 5.0)
    known = sorted(each for each in events if not math.isnan(each[0]))
    times, codes = np.array([*known, (known[-1][0] - 0.5, 51.0)]).T  # one that is learnt late
    estimate = DrtResponse(ANSWERS)
    estimate.begin(CODES)
    found = [estimate.update(times[[at]], codes[[at], None]) for at in range(len(times))][-1]
    expected = [answer for begun, answer in hits if begun > known[-1][0] - ANSWERS.window_s]
    assert found is not None
    assert found.values[0] == pytest.approx(np.mean(expected))
    assert found.time == known[-1][0]


def test_without_a_hit_in_the_window_there_is_no_response_time() -> None:
    estimate = DrtResponse(ANSWERS)
    estimate.begin(CODES)
    assert estimate.update(np.array([1.0]), np.array([[112.0]])) is None, "not decided yet"
    found = estimate.update(np.array([3.56]), np.array([[114.0]]))
    assert found is not None
    assert math.isnan(found.values[0])


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
