"""Faults of signals are told within 5 s, by their name and channel, and living signals are not."""

import re
from collections import Counter

import numpy as np
import pytest
import synthetic_signals as synthetic

import labcrane_signals
from labcrane import FloatArray, SignalMonitor
from labcrane.core import SignalChannel, SignalStream
from labcrane.testing import SignalMonitorContract, ch8

WITHIN_S = 5.0
FOUND = 0.95


def monitors(stream: SignalStream) -> list[SignalMonitor]:
    """Return every monitor of the plugin that knows a stream, as it is without settings."""
    offers = labcrane_signals.labcrane_monitors()
    built = [offer.build(offer.settings(), ch8()) for offer in offers]
    known = [monitor for monitor in built if monitor.knows(stream)]
    for monitor in known:
        monitor.begin(stream)
    return known


def built(name: str, **settings: object) -> SignalMonitor:
    """Return a monitor by the name under which it is offered."""
    (offer,) = (each for each in labcrane_signals.labcrane_monitors() if each.name == name)
    return offer.build(offer.settings.model_validate(settings), ch8())


def told(case: synthetic.Case, rng: np.random.Generator) -> float:
    """Return how long after its onset a fault is told of the right channel, in s; inf for never."""
    known = monitors(case.stream)
    for at, piece in synthetic.pieces(rng, case.samples, case.stream.rate_hz):
        end = at + len(piece)
        faults = [fault for each in known for fault in each.look(np.empty(len(piece)), piece)]
        mine = [fault for fault in faults if fault.kind == case.kind]
        if any(fault.channel in case.channels for fault in mine) and end > case.onset:
            return (end - case.onset) / case.stream.rate_hz
    return np.inf


def missed(kind: str, seeds: range) -> list[int]:
    """Return the seeds of which a fault is not told in time."""
    late = []
    for seed in seeds:
        rng = np.random.default_rng([seed, *kind.encode()])
        if told(synthetic.CASES[kind](rng), rng) > WITHIN_S:
            late.append(seed)
    return late


def alarms(kind: str, hours: float, seed: int) -> tuple[float, list[str]]:
    """Return how many hours of clean signals were looked at, and what was told of them."""
    seen, found = 0.0, []
    session = 0
    while seen < hours:
        rng = np.random.default_rng([seed, session])
        session += 1
        if kind == "EEG":
            rate = float(rng.choice([rate for rate in synthetic.EEG_RATES if rate <= 1000]))
            head = synthetic.a_head(rng, rate, int(rng.choice([8, 16, 32])))
            stream, scale = head.stream, synthetic.UNITS[head.unit]
            stretches = (synthetic.eeg(rng, head, 120.0) * scale for _ in range(5))
        else:
            eyes = synthetic.some_eyes(rng)
            stream = eyes.stream
            stretches = (synthetic.gaze(rng, eyes, 300.0)[0] for _ in range(2))
        known, before = monitors(stream), set()
        for samples in stretches:
            step = round(stream.rate_hz / 2.0)
            for at in range(0, len(samples), step):
                piece = samples[at : at + step]
                faults = [f for each in known for f in each.look(np.empty(len(piece)), piece)]
                now = {(fault.channel, fault.kind) for fault in faults}
                found += [f"{stream.rate_hz:g} Hz: {each}" for each in now - before]
                before = now
            seen += len(samples) / stream.rate_hz / 3600.0
    return seen, found


@pytest.mark.parametrize("kind", synthetic.CASES)
def test_a_fault_is_told_of_its_channel_within_five_seconds(kind: str) -> None:
    assert missed(kind, range(1000, 1004)) == []


@pytest.mark.soak
@pytest.mark.parametrize("kind", synthetic.CASES)
def test_faults_are_told_within_five_seconds_over_a_hundred_seeds(kind: str) -> None:
    late = missed(kind, range(100))
    assert len(late) <= (1.0 - FOUND) * 100, late


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["EEG", "gaze"])
def test_nothing_is_told_of_living_signals(kind: str) -> None:
    hours, found = alarms(kind, 0.1, seed=3)
    assert hours >= 0.1
    assert found == []


@pytest.mark.soak
def test_ten_hours_of_living_eeg_and_gaze_give_one_false_alarm_at_most() -> None:
    found = [each for kind in ("EEG", "gaze") for each in alarms(kind, 10.0, seed=4)[1]]
    assert len(found) <= 1, Counter(found)


def eeg_stream(rate: float = 250.0, channels: int = 8, unit: str = "microvolts") -> SignalStream:
    named = tuple(SignalChannel(f"E{at}", unit, "EEG") for at in range(channels))
    return SignalStream("Amplifier", "EEG", rate, named)


@pytest.mark.parametrize(
    ("label", "kind"), [("Photodiode", "EEG"), ("D1", "AUX"), ("light", "misc"), ("skin", "GSR")]
)
def test_a_sensor_beside_electrodes_gets_no_advice_about_gel(label: str, kind: str) -> None:
    """A diode sees nothing for 15 s, and then pictures that flicker, in the electrodes' unit."""
    rng = np.random.default_rng()
    head = synthetic.a_head(rng, 250.0, 8)
    scale = synthetic.UNITS[head.unit]
    seconds = np.arange(30 * 250) / 250.0
    light = (seconds > 15.0) * 3000.0 * (np.sin(2 * np.pi * 60.0 * seconds) > 0.0)
    light += 400.0 * rng.standard_normal(len(light)) * (seconds > 20.0)
    samples = np.column_stack([synthetic.eeg(rng, head, 30.0), light]) * scale
    channels = (*head.stream.channels, SignalChannel(label, head.unit, kind))
    known = monitors(SignalStream("Amplifier", "EEG", 250.0, channels))
    faults = [
        fault
        for at in range(0, len(samples), 125)
        for each in known
        for fault in each.look(np.empty(125), samples[at : at + 125])
    ]
    assert faults == []


def test_a_fault_that_ends_is_told_no_more() -> None:
    rng = np.random.default_rng(5)
    head = synthetic.a_head(rng, 250.0, 8)
    signal = synthetic.eeg(rng, head, 20.0) * synthetic.UNITS[head.unit]
    signal[2500:3750, 3] = signal[2500, 3]
    (monitor,) = monitors(head.stream)
    when = {}
    for second in range(20):
        piece = signal[250 * second : 250 * (second + 1)]
        when[second + 1] = {(f.channel, f.kind) for f in monitor.look(np.empty(250), piece)}
    assert when[10] == set()
    assert when[15] == {("E3", "flat line")}
    assert when[20] == set()


def test_both_electrodes_of_a_bridge_name_each_other() -> None:
    rng = np.random.default_rng(6)
    case = synthetic.eeg_case("bridged electrode", rng)
    (monitor,) = monitors(case.stream)
    faults = monitor.look(np.empty(len(case.samples)), case.samples)
    texts = {fault.channel: fault.message for fault in faults if fault.kind == case.kind}
    one, other = sorted(case.channels)
    assert f"has the same signal as {other}" in texts[one]
    assert f"has the same signal as {one}" in texts[other]


def test_the_frequency_of_the_mains_is_told() -> None:
    rng = np.random.default_rng(7)
    signal = 10.0 * synthetic.pink(rng, 2500, 250.0, 1.0, 8).T
    signal += 40.0 * np.sqrt(2.0) * np.sin(2.0 * np.pi * 60.0 * np.arange(2500) / 250.0)[:, None]
    (monitor,) = monitors(eeg_stream())
    faults = monitor.look(np.empty(2500), signal)
    assert {fault.kind for fault in faults} == {"mains hum"}
    assert all(re.match("(39|40|41) µV at 60 Hz", fault.message) for fault in faults), faults
    european = built("eeg_signal", mains_hz=50)
    european.begin(eeg_stream())
    assert not european.look(np.empty(2500), signal)


def test_counters_and_triggers_may_stand_still_or_jump() -> None:
    rng = np.random.default_rng(8)
    channels = (
        SignalChannel("level", "V"),
        SignalChannel("SampleCounter", ""),
        SignalChannel("Status", ""),
    )
    (monitor,) = monitors(SignalStream("Sensor", "Something", 100.0, channels))
    samples = np.column_stack([rng.standard_normal(3000), np.arange(3000), np.zeros(3000)])
    assert not monitor.look(np.empty(3000), samples)
    samples[:, 0] = samples[-1, 0]
    (fault,) = monitor.look(np.empty(3000), samples)
    assert (fault.channel, fault.kind) == ("level", "flat line")


def test_a_channel_that_rests_now_and_then_is_not_flat() -> None:
    rng = np.random.default_rng(9)
    stream = SignalStream("Pedals", "Something", 100.0, (SignalChannel("a"), SignalChannel("b")))
    (monitor,) = monitors(stream)
    for second in range(120):
        samples = rng.standard_normal((100, 2))
        if second // 8 % 2:
            samples[:, 0] = 0.0
        assert not monitor.look(np.empty(100), samples), second


def test_sticks_that_are_let_go_of_are_not_dead() -> None:
    rng = np.random.default_rng(10)
    samples = synthetic.sticks(rng, 100.0, 60.0, axes=4, lsb=2.0**-10, dead=0.04)
    samples[4000:] = 0.0
    names = tuple(SignalChannel(f"axis{at}", "normalized", "Axis") for at in range(4))
    (monitor,) = monitors(SignalStream("Sticks", "Joystick", 100.0, names))
    for at in range(0, 6000, 50):
        assert not monitor.look(np.empty(50), samples[at : at + 50]), at


def test_a_force_beyond_the_sensor_is_a_wrong_unit() -> None:
    monitor = built("force_signal", largest=500.0)
    monitor.begin(SignalStream("Grip", "Force", 100.0, (SignalChannel("grip", "N"),)))
    force = 40.0 + np.random.default_rng(11).standard_normal((500, 1))
    assert not monitor.look(np.empty(500), force)
    (fault,) = monitor.look(np.empty(500), 1000.0 * force)
    assert fault.kind == "wrong unit"
    assert "beyond 500" in fault.message


class TestEeg(SignalMonitorContract):
    head = synthetic.a_head(np.random.default_rng(1), 250.0, 16)

    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("eeg_signal")

    @pytest.fixture
    def stream(self) -> SignalStream:
        return self.head.stream

    @pytest.fixture
    def clean(self) -> FloatArray:
        scale = synthetic.UNITS[self.head.unit]
        return synthetic.eeg(np.random.default_rng(2), self.head, 10.0) * scale


class TestGaze(SignalMonitorContract):
    eyes = synthetic.Eyes(120.0, "pixels", "nan", 0.003, 4.0, confidence=True)

    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("gaze_signal")

    @pytest.fixture
    def stream(self) -> SignalStream:
        return self.eyes.stream

    @pytest.fixture
    def clean(self) -> FloatArray:
        return synthetic.gaze(np.random.default_rng(3), self.eyes, 30.0)[0]


class TestEcg(SignalMonitorContract):
    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("ecg_signal")

    @pytest.fixture
    def stream(self) -> SignalStream:
        return SignalStream("Heart", "ECG", 500.0, (SignalChannel("II", "mV"),))

    @pytest.fixture
    def clean(self) -> FloatArray:
        time = np.arange(5000) / 500.0
        beat = np.exp(-0.5 * ((time % 0.85 - 0.3) / 0.012) ** 2)
        wave = 0.2 * np.exp(-0.5 * ((time % 0.85 - 0.55) / 0.05) ** 2)
        noise = 0.01 * np.random.default_rng(4).standard_normal(5000)
        return (beat + wave + noise)[:, None]


class TestEmg(SignalMonitorContract):
    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("emg_signal")

    @pytest.fixture
    def stream(self) -> SignalStream:
        channels = (SignalChannel("forearm", "uV"), SignalChannel("biceps", "uV"))
        return SignalStream("Muscles", "EMG", 1000.0, channels)

    @pytest.fixture
    def clean(self) -> FloatArray:
        rng = np.random.default_rng(5)
        force = 5.0 + 200.0 * (synthetic.band(rng, 8000, 1000.0, 0.1, 1.0, 2) > 1.0)
        return (force * synthetic.band(rng, 8000, 1000.0, 20.0, 450.0, 2)).T


class TestForce(SignalMonitorContract):
    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("force_signal", largest=1000.0)

    @pytest.fixture
    def stream(self) -> SignalStream:
        return SignalStream("Grip", "Force", 200.0, (SignalChannel("grip", "N"),))

    @pytest.fixture
    def clean(self) -> FloatArray:
        rng = np.random.default_rng(6)
        return (
            50.0
            + 20.0 * synthetic.band(rng, 2000, 200.0, 0.1, 2.0).T
            + rng.normal(0, 0.1, (2000, 1))
        )


class TestSticks(SignalMonitorContract):
    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("stick_signal")

    @pytest.fixture
    def stream(self) -> SignalStream:
        names = tuple(SignalChannel(name, "normalized", "Axis") for name in ("x", "y"))
        return SignalStream("Sticks", "Joystick", 100.0, names)

    @pytest.fixture
    def clean(self) -> FloatArray:
        rng = np.random.default_rng(7)
        return synthetic.sticks(rng, 100.0, 20.0, axes=2, lsb=2.0**-12, dead=0.02)


class TestAny(SignalMonitorContract):
    @pytest.fixture
    def monitor(self) -> SignalMonitor:
        return built("any_signal")

    @pytest.fixture
    def stream(self) -> SignalStream:
        return SignalStream("Sensor", "Something", 50.0, (SignalChannel("a"), SignalChannel("b")))

    @pytest.fixture
    def clean(self) -> FloatArray:
        return np.random.default_rng(8).standard_normal((1000, 2))
