"""Signals of people that nobody has recorded: EEG, gaze and sticks, and what goes wrong with them.

Drawn at random within what laboratories see. Nothing here knows how faults are found.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from labcrane import FloatArray
from labcrane.core import SignalChannel, SignalStream

Rng = np.random.Generator

EEG_RATES = (125, 128, 200, 250, 256, 300, 500, 512, 1000, 1024, 2000)
GAZE_RATES = (30, 60, 90, 120, 200, 250, 300, 500, 1000)
UNITS = {"microvolts": 1.0, "uV": 1.0, "µV": 1.0, "": 1.0, "mV": 1e-3, "V": 1e-6, "nV": 1e3}


def pink(rng: Rng, n: int, rate: float, slope: float, rows: int, low: float = 0.5) -> FloatArray:
    """Return noise with power 1/f**slope above ``low`` Hz, variance 1, shape ``(rows, n)``."""
    size = 1 << (n - 1).bit_length()
    frequency = np.maximum(np.fft.rfftfreq(size, 1.0 / rate), low)
    shape = frequency ** (-slope / 2.0)
    shape[0] = 0.0
    spectrum = shape * (
        rng.standard_normal((rows, len(shape))) + 1j * rng.standard_normal((rows, len(shape)))
    )
    noise = np.fft.irfft(spectrum, size)[:, :n]
    return noise / noise.std(axis=1, keepdims=True)


def band(rng: Rng, n: int, rate: float, low: float, high: float, rows: int = 1) -> FloatArray:
    """Return noise from ``low`` to ``high`` Hz, variance 1, shape ``(rows, n)``."""
    size = max(1 << (n - 1).bit_length(), 64)
    frequency = np.fft.rfftfreq(size, 1.0 / rate)
    inside = (frequency >= low) & (frequency <= high)
    if not inside.any():
        inside[np.argmin(np.abs(frequency - low))] = True
    spectrum = inside * (
        rng.standard_normal((rows, len(inside))) + 1j * rng.standard_normal((rows, len(inside)))
    )
    noise = np.fft.irfft(spectrum, size)[:, :n]
    return noise / noise.std(axis=1, keepdims=True)


def moments(rng: Rng, seconds: float, per_minute: float) -> FloatArray:
    """Return when something happens that happens so often, in seconds."""
    return np.sort(rng.uniform(0.0, seconds, rng.poisson(per_minute * seconds / 60.0)))


@dataclass(frozen=True)
class Head:
    """One person under one cap: what stays the same for a session."""

    rate: float
    places: FloatArray  # on the unit sphere, x to the right, y to the front
    sources: FloatArray
    mixing: FloatArray  # (n_sources, n_channels)
    slope: float
    alpha: FloatArray
    alpha_hz: float
    blink: FloatArray
    sideways: FloatArray
    offset: FloatArray
    noise: FloatArray
    mains: FloatArray
    mains_hz: float
    lsb: float
    unit: str

    @property
    def stream(self) -> SignalStream:
        """What the header says."""
        names = tuple(SignalChannel(f"E{at}", self.unit, "EEG") for at in range(len(self.places)))
        return SignalStream("Amplifier", "EEG", self.rate, names)


def a_head(rng: Rng, rate: float, channels: int) -> Head:
    """Draw a person and a cap."""
    at = np.arange(channels) + 0.5
    height = 1.0 - at / channels  # the upper half, evenly (Fibonacci)
    turn = at * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - height**2)
    places = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    sources = rng.standard_normal((max(40, channels), 3))
    sources[:, 2] = np.abs(sources[:, 2])
    sources /= np.linalg.norm(sources, axis=1, keepdims=True)
    mixing = _spread(sources, places, rng.uniform(0.35, 0.7))
    mixing /= np.sqrt((mixing**2).sum(axis=0))
    mixing *= rng.uniform(6.0, 15.0) * rng.uniform(0.8, 1.25, channels)  # µV
    back = _spread(np.array([[0.0, -0.9, 0.4]]), places, 0.7)[0]
    front = _spread(np.array([[0.0, 0.95, 0.2]]), places, 0.5)[0]
    return Head(
        rate=rate,
        places=places,
        sources=sources,
        mixing=mixing,
        slope=rng.uniform(1.0, 1.8),
        alpha=back * rng.uniform(3.0, 20.0),
        alpha_hz=rng.uniform(8.5, 11.5),
        blink=front * rng.uniform(80.0, 250.0),
        sideways=places[:, 0] * front * rng.uniform(20.0, 60.0),
        offset=rng.uniform(-10_000.0, 10_000.0, channels) * rng.integers(0, 2),
        noise=rng.uniform(0.3, 0.7, channels),
        mains=rng.uniform(0.2, 3.0, channels),
        mains_hz=rng.choice([50.0, 60.0]) + rng.uniform(-0.1, 0.1),
        lsb=float(rng.choice([0.02, 0.05, 0.1, 0.25, 0.5])),
        unit=str(rng.choice(list(UNITS))),
    )


def _spread(sources: FloatArray, places: FloatArray, width: float) -> FloatArray:
    angle = np.arccos(np.clip(sources @ places.T, -1.0, 1.0))
    return np.exp(-0.5 * (angle / width) ** 2)


def eeg(rng: Rng, head: Head, seconds: float) -> FloatArray:
    """Return clean EEG in µV, shape ``(n, n_channels)``: with blinks, eye movements, muscles."""
    rate, count, n = head.rate, len(head.places), round(seconds * head.rate)
    time = np.arange(n) / rate
    signal = (head.mixing.T @ pink(rng, n, rate, head.slope, len(head.sources))).T
    envelope = np.abs(band(rng, n, rate, 0.0, 0.3)[0])
    alpha = band(rng, n, rate, head.alpha_hz - 1.0, head.alpha_hz + 1.0)[0] * envelope
    signal += alpha[:, None] * head.alpha
    _blinks(rng, signal, head, seconds)
    _eye_movements(rng, signal, head, seconds)
    _muscles(rng, signal, head, seconds)
    drift = pink(rng, n, rate, 2.0, count, low=0.01).T * rng.uniform(2.0, 30.0, count)
    signal += drift + head.offset
    signal += rng.standard_normal((n, count)) * head.noise
    hum = np.sqrt(2.0) * np.sin(2.0 * np.pi * head.mains_hz * time)
    signal += hum[:, None] * head.mains
    return np.round(signal / head.lsb) * head.lsb


def _blinks(rng: Rng, signal: FloatArray, head: Head, seconds: float) -> None:
    for when in moments(rng, seconds, 15.0):
        length = round(rng.uniform(0.2, 0.45) * head.rate)
        shape = np.hanning(length)[:, None] * head.blink * rng.uniform(0.5, 1.2)
        _add(signal, shape, when * head.rate)


def _eye_movements(rng: Rng, signal: FloatArray, head: Head, seconds: float) -> None:
    for when in moments(rng, seconds, 30.0):
        length = round(rng.uniform(0.3, 2.0) * head.rate)
        decay = np.exp(-np.arange(length) / (rng.uniform(0.5, 3.0) * head.rate))
        _add(signal, decay[:, None] * head.sideways * rng.uniform(-1.0, 1.0), when * head.rate)


def _muscles(rng: Rng, signal: FloatArray, head: Head, seconds: float) -> None:
    for when in moments(rng, seconds, 3.0):
        length = round(rng.uniform(0.3, 2.0) * head.rate)
        centre = head.places[rng.integers(len(head.places))]
        near = _spread(centre[None], head.places, rng.uniform(0.15, 0.6))[0]
        burst = band(rng, length, head.rate, 20.0, min(200.0, 0.45 * head.rate), len(near)).T
        # Fibres of one muscle are not the same under each electrode, but nearly are under two.
        burst = 0.7 * burst[:, :1] + 0.7 * burst
        size = near * rng.uniform(10.0, 50.0)
        _add(signal, np.hanning(length)[:, None] ** 0.25 * burst * size, when * head.rate)


def _add(signal: FloatArray, shape: FloatArray, at: float) -> None:
    begin = int(at)
    shape = shape[: len(signal) - begin]
    signal[begin : begin + len(shape)] += shape


# ---------------------------------------------------------------------------- faults of electrodes


def _flat(rng: Rng, signal: FloatArray, head: Head, at: int) -> list[int]:
    (channel,) = rng.choice(signal.shape[1], 1)
    noise = rng.choice([0.0, rng.uniform(0.01, 0.1)])
    n = len(signal) - at
    signal[at:, channel] = signal[at, channel] + noise * rng.standard_normal(n)
    return [int(channel)]


def _railing(rng: Rng, signal: FloatArray, head: Head, at: int) -> list[int]:
    (channel,) = rng.choice(signal.shape[1], 1)
    part = signal[at:, channel]
    middle = part.mean()
    if rng.integers(2):  # it runs away to the rail
        side = rng.choice([-1, 1])
        rail = middle + side * rng.uniform(2_000.0, 400_000.0)
        went = np.minimum(np.arange(len(part)) / (rng.uniform(0.05, 0.5) * head.rate), 1.0)
        away = np.where(went < 1.0, part + went * (rail - middle), rail)
        signal[at:, channel] = side * np.minimum(
            side * away, side * rail
        )  # no converter overshoots
    else:  # it swings too far
        rail = np.quantile(np.abs(part - middle), rng.uniform(0.3, 0.7))
        signal[at:, channel] = middle + np.clip(part - middle, -rail, rail)
    return [int(channel)]


def _hum(rng: Rng, signal: FloatArray, head: Head, at: int) -> list[int]:
    several = rng.integers(1, signal.shape[1] + 1) if rng.integers(2) else 1
    channels = rng.choice(signal.shape[1], several, replace=False)
    time = np.arange(len(signal) - at) / head.rate
    phase = rng.uniform(0.0, 2.0 * np.pi)
    hum = np.sin(2.0 * np.pi * head.mains_hz * time + phase)
    if head.rate > 400:
        hum += rng.uniform(0.0, 0.4) * np.sin(6.0 * np.pi * head.mains_hz * time)
    size = np.exp(rng.uniform(np.log(20.0), np.log(500.0))) * rng.uniform(0.8, 1.2, several)
    signal[at:, channels] += np.sqrt(2.0) * hum[:, None] * size
    return [int(channel) for channel in channels]


def _disconnected(rng: Rng, signal: FloatArray, head: Head, at: int) -> list[int]:
    (channel,) = rng.choice(signal.shape[1], 1)
    n = len(signal) - at
    time = np.arange(n) / head.rate
    density = np.exp(rng.uniform(np.log(5.0), np.log(50.0)))
    open_input = density * np.sqrt(head.rate / 2.0) * rng.standard_normal(n)
    open_input += rng.uniform(0.0, 300.0) * pink(rng, n, head.rate, 2.0, 1, low=0.05)[0]
    open_input += rng.uniform(0.0, 300.0) * np.sin(2.0 * np.pi * head.mains_hz * time)
    signal[at:, channel] = head.offset[channel] + open_input
    return [int(channel)]


def _bridged(rng: Rng, signal: FloatArray, head: Head, at: int) -> list[int]:
    channel = int(rng.integers(signal.shape[1]))
    away = np.linalg.norm(head.places - head.places[channel], axis=1)
    other = int(np.argsort(away)[1])
    pair = [channel, other]
    n = len(signal) - at
    both = (signal[at:, pair] - head.offset[pair]).mean(axis=1, keepdims=True)
    signal[at:, pair] = both + head.offset[pair] + head.noise[pair] * rng.standard_normal((n, 2))
    return pair


EEG_FAULTS: dict[str, Callable[[Rng, FloatArray, Head, int], list[int]]] = {
    "flat line": _flat,
    "railing": _railing,
    "mains hum": _hum,
    "disconnected electrode": _disconnected,
    "bridged electrode": _bridged,
}
"""What goes wrong with electrodes, from a sample on; returns the channels."""


@dataclass(frozen=True)
class Case:
    """A signal with one fault in it.

    Attributes
    ----------
    onset
        The first sample that is wrong.
    channels
        Which are wrong, by label; any of them may be named.
    """

    stream: SignalStream
    samples: FloatArray
    onset: int
    kind: str
    channels: frozenset[str]


def eeg_case(kind: str, rng: Rng) -> Case:
    """Draw EEG with a fault, in the unit of its header."""
    rate = float(rng.choice(EEG_RATES))
    head = a_head(rng, rate, int(rng.choice([8, 16, 32, 64])))
    seconds = rng.uniform(4.0, 12.0)
    signal = eeg(rng, head, seconds + 5.0)
    at = round(seconds * rate)
    channels = EEG_FAULTS[kind](rng, signal, head, at)
    stream = head.stream
    labels = frozenset(stream.channels[channel].label for channel in channels)
    return Case(stream, signal * UNITS[head.unit], at, kind, labels)


def unit_case(rng: Rng) -> Case:
    """Draw a signal whose header states the wrong unit, from its first sample on."""
    which = rng.integers(3)
    if which == 0:
        rate = float(rng.choice(EEG_RATES))
        head = a_head(rng, rate, int(rng.choice([8, 16, 32, 64])))
        wrong = float(rng.choice([1e-6, 1e-3, 1e3, 1e6]))
        samples = eeg(rng, head, 5.0) * UNITS[head.unit] * wrong
        return Case(head.stream, samples, 0, "wrong unit", frozenset({""}))
    eyes = some_eyes(rng)
    samples, _ = gaze(rng, eyes, 5.0)
    if which == 1:  # positions in the other unit
        eyes = replace(eyes, unit=str(rng.choice(["normalized", "pixels"])))
        samples, _ = gaze(rng, eyes, 5.0)
        samples[:, :2] *= SCREEN[0] if eyes.unit == "normalized" else 1.0 / SCREEN[0]
        return Case(eyes.stream, samples, 0, "wrong unit", frozenset({"x"}))
    samples[:, 2] *= rng.choice([1e-3, 1e3])
    return Case(eyes.stream, samples, 0, "wrong unit", frozenset({"pupil"}))


# -------------------------------------------------------------------------------------------- gaze

SCREEN = (1920.0, 1080.0)
SCALES = {"normalized": (1.0, 1.0), "pixels": SCREEN, "degrees": (40.0, 25.0)}


@dataclass(frozen=True)
class Eyes:
    """One person before one eye tracker."""

    rate: float
    unit: str
    lost: str  # what it sends when it sees no eye
    noise: float
    pupil_mm: float
    confidence: bool

    @property
    def stream(self) -> SignalStream:
        """What the header says."""
        channels = [
            SignalChannel("x", self.unit, "ScreenX"),
            SignalChannel("y", self.unit, "ScreenY"),
            SignalChannel("pupil", "mm", "Diameter"),
        ]
        if self.confidence:
            channels.append(SignalChannel("confidence", "normalized", "Confidence"))
        return SignalStream("Tracker", "Gaze", self.rate, tuple(channels))


def some_eyes(rng: Rng) -> Eyes:
    """Draw a person and an eye tracker."""
    confidence = bool(rng.integers(2))
    ways = ["nan", "zero", "hold", *(["confidence"] if confidence else [])]
    return Eyes(
        rate=float(rng.choice(GAZE_RATES)),
        unit=str(rng.choice(list(SCALES))),
        lost=str(rng.choice(ways)),
        noise=rng.uniform(0.0005, 0.006),
        pupil_mm=rng.uniform(2.5, 6.0),
        confidence=confidence,
    )


def gaze(rng: Rng, eyes: Eyes, seconds: float) -> tuple[FloatArray, FloatArray]:
    """Return gaze in the unit of its header, and where a blink or a drop-out is.

    Fixations of 0.15 to 0.8 s with drift and tremor, saccades, glances beyond the screen, blinks,
    single lost samples, and pupils that wander.
    """
    rate, n = eyes.rate, round(seconds * eyes.rate)
    place = _fixations(rng, rate, n)
    place += np.cumsum(rng.standard_normal((n, 2)), axis=0) * 0.0  # drift is in the fixations
    place += eyes.noise * rng.standard_normal((n, 2))
    pupil = eyes.pupil_mm + 0.35 * band(rng, n, rate, 0.05, 0.6)[0]
    pupil = np.clip(pupil, 1.9, 7.8) + 0.02 * rng.standard_normal(n)
    sure = np.clip(1.0 - 0.05 * np.abs(rng.standard_normal(n)), 0.0, 1.0)
    none = rng.random(n) < rng.uniform(0.0, 0.02)
    for when in moments(rng, seconds, 17.0):
        length = rng.uniform(0.1, 0.4) if rng.random() > 0.03 else rng.uniform(0.4, 0.9)
        begin, end = int(when * rate), int((when + length) * rate) + 1
        none[begin:end] = True
        edge = slice(max(begin - 2, 0), begin)
        pupil[edge] -= rng.uniform(0.2, 1.5)  # half a pupil under the lid
    scale = np.array(SCALES[eyes.unit])
    centre = 0.5 if eyes.unit == "degrees" else 0.0
    samples = np.column_stack([(place - centre) * scale, pupil, sure])
    lose(eyes, samples, none)
    return samples[:, : len(eyes.stream.channels)], none


def _fixations(rng: Rng, rate: float, n: int) -> FloatArray:
    place = np.empty((n, 2))
    at, here = 0, rng.uniform(0.1, 0.9, 2)
    while at < n:
        target = rng.uniform(0.05, 0.95, 2)
        if rng.random() < 0.02:
            target = rng.uniform(-0.3, 1.3, 2)
        jump = max(round(rng.uniform(0.02, 0.06) * rate), 1)
        stay = max(round(rng.uniform(0.15, 0.8) * rate), 1)
        ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(jump) + 1.0) / jump)
        drift = np.cumsum(rng.standard_normal((stay, 2)), axis=0) * 0.002 / np.sqrt(rate)
        piece = np.vstack([here + ramp[:, None] * (target - here), target + drift])[: n - at]
        place[at : at + len(piece)] = piece
        at, here = at + len(piece), piece[-1]
    return place


def lose(eyes: Eyes, samples: FloatArray, none: FloatArray) -> None:
    """Write what the tracker sends when it sees no eye."""
    where = np.flatnonzero(none)
    samples[where, 3:] = 0.0 if eyes.confidence else samples[where, 3:]
    if eyes.lost == "nan":
        samples[where, :3] = np.nan
    elif eyes.lost == "zero":
        samples[where, :3] = 0.0
    elif eyes.lost == "hold":
        seen = np.maximum.accumulate(np.where(none, 0, np.arange(len(none))))
        samples[:, :3] = samples[seen, :3]


def gaze_lost_case(rng: Rng) -> Case:
    """Draw gaze that is lost: the eyes are closed, the headset has slipped."""
    eyes = some_eyes(rng)
    seconds = rng.uniform(3.0, 10.0)
    samples, _ = gaze(rng, eyes, seconds + 5.0)
    at = round(seconds * eyes.rate)
    none = np.zeros(len(samples), dtype=bool)
    none[at:] = rng.random(len(samples) - at) < rng.uniform(0.92, 1.0)
    if eyes.lost == "hold":
        none[at:] = True
    wide = np.column_stack([samples, np.zeros(len(samples))]) if not eyes.confidence else samples
    lose(eyes, wide, none)
    return Case(eyes.stream, wide[:, : samples.shape[1]], at, "gaze lost", frozenset({"x"}))


def pupil_case(rng: Rng) -> Case:
    """Draw gaze with a pupil that cannot be."""
    eyes = some_eyes(rng)
    seconds = rng.uniform(3.0, 10.0)
    samples, _ = gaze(rng, eyes, seconds + 5.0)
    at = round(seconds * eyes.rate)
    pupil = samples[at:, 2]
    n = len(pupil)
    match rng.integers(3):
        case 0:  # the iris, or a lash, is taken for the pupil
            size = rng.uniform(10.5, 25.0) if rng.integers(2) else rng.uniform(0.2, 1.0)
            samples[at:, 2] = pupil * size / np.nanmedian(np.where(pupil > 0, pupil, np.nan))
        case 1:  # its outline is found anew in every picture
            samples[at:, 2] = np.clip(
                pupil + rng.uniform(1.5, 4.0) * rng.standard_normal(n), 0.1, 12
            )
        case _:
            samples[at:, 2] = pupil[np.isfinite(pupil) & (pupil > 0)][0]
    return Case(eyes.stream, samples, at, "pupil implausible", frozenset({"pupil"}))


# ------------------------------------------------------------------------------------------ sticks


def sticks(
    rng: Rng, rate: float, seconds: float, *, axes: int, lsb: float, dead: float
) -> FloatArray:
    """Return axes that hands move and let go of, shape ``(n, axes)``, -1 to 1."""
    n = round(rate * seconds)
    moved = 0.7 * band(rng, n, rate, 0.1, 3.0, axes).T
    held = np.repeat(rng.random((n // round(3 * rate) + 1, axes)) < 0.7, round(3 * rate), axis=0)[
        :n
    ]
    value = np.clip(moved * held + 0.004 * rng.standard_normal((n, axes)), -1.0, 1.0)
    value[np.abs(value) < dead] = 0.0
    return np.round(value / lsb) * lsb


def stick_case(rng: Rng) -> Case:
    """Draw sticks that die while they are held."""
    rate, axes = float(rng.choice([60, 100, 125, 240, 500, 1000])), int(rng.integers(2, 7))
    seconds = rng.uniform(4.0, 12.0)
    samples = sticks(
        rng,
        rate,
        seconds + 5.0,
        axes=axes,
        lsb=2.0 ** -float(rng.integers(7, 16)),
        dead=float(rng.choice([0.0, 0.02, 0.04])),
    )
    held = np.flatnonzero((np.abs(samples) > 0.1).any(axis=1) & (np.abs(samples) < 0.9).all(axis=1))
    held = held[held <= round(seconds * rate)]
    at = int(held[-1])
    samples = samples[: at + round(5.0 * rate)]
    samples[at:] = samples[at]
    names = tuple(SignalChannel(f"axis{each}", "normalized", "Axis") for each in range(axes))
    dead = frozenset(f"axis{each}" for each in np.flatnonzero(np.abs(samples[at]) > 0.1))
    return Case(SignalStream("Sticks", "Joystick", rate, names), samples, at, "sticks dead", dead)


CASES: dict[str, Callable[[Rng], Case]] = {
    **{kind: (lambda rng, kind=kind: eeg_case(kind, rng)) for kind in EEG_FAULTS},
    "gaze lost": gaze_lost_case,
    "pupil implausible": pupil_case,
    "sticks dead": stick_case,
    "wrong unit": unit_case,
}
"""One drawn at random, by the fault in it."""


def pieces(rng: Rng, samples: FloatArray, rate: float) -> Iterator[tuple[int, FloatArray]]:
    """Yield samples as they come, in chunks of 1 ms to 0.3 s, and how many came before each."""
    at = 0
    while at < len(samples):
        size = max(round(rng.uniform(0.001, 0.3) * rate), 1)
        yield at, samples[at : at + size]
        at += size
