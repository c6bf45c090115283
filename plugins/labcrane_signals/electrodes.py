"""Voltages of electrodes: EEG, ECG and EMG.

Every half second the last second is judged by its power spectrum (Hann window) and, for EEG, by
how much each pair of electrodes differs. A bridge of gel makes two electrodes the same up to the
noise of their amplifiers (Tenke and Kayser 2001, Clin. Neurophysiol. 112, 545-550). An open input
picks up broad noise and hum that its neighbours do not have.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from labcrane import FloatArray
from labcrane.core import SignalFault, SignalStream
from labcrane_signals.channels import electrodes
from labcrane_signals.rails import Rails
from labcrane_signals.settings import ElectrodeSettings
from labcrane_signals.windows import BoolArray, Streak, WindowedMonitor

MAINS_HZ = (50, 60)
HUM_RATIO = 10.0
"""Minimum ratio of the power at the mains frequency to that at neighbouring frequencies."""

BAND_HZ = (1.0, 40.0)
NOISE_HZ = (20.0, 45.0)
SEVERAL = 4
"""Channels from which on one can be compared with the others."""

WINDOWS = {
    "no values": 4,
    "wrong unit": 6,
    "flat line": 5,
    "railing": 3,
    "mains hum": 5,
    "disconnected electrode": 6,
    "bridged electrode": 6,
}
"""Number of half-second windows that a fault must last before it is reported."""

ADVICE = {
    "no values": "sends no numbers: check the amplifier's program",
    "wrong unit": "median of all channels {rms:.3g} µV, in the unit that the header states: "
    "correct the unit or the scale in the amplifier's program",
    "flat line": "does not move: check its cable, and that the channel is switched on",
    "railing": "is held at the converter's limit: check the electrode's contact and the range",
    "mains hum": "{hum:.0f} µV at {mains} Hz: check its contact and the reference, and move cables "
    "and power supplies away",
    "disconnected electrode": "noise of {noise:.1f} µV/√Hz, beyond all other channels: put gel, "
    "press it on, check its cable",
    "bridged electrode": "has the same signal as {other}: remove the gel between the two",
}


@dataclass(frozen=True, slots=True)
class Expected:
    """What living signals of a kind have.

    Attributes
    ----------
    types
        Types of streams, in lower case.
    least_uv, most_uv
        The middle channel's root mean square from 1 to 40 Hz: beyond, the unit is wrong.
    noise
        Density from 20 to 45 Hz beyond which an input is open, in µV/√Hz.
    pairs
        Whether electrodes are close enough to be bridged.
    """

    types: frozenset[str]
    least_uv: float
    most_uv: float
    noise: float = np.inf
    pairs: bool = False


EEG = Expected(frozenset({"eeg"}), 0.1, 1000.0, 3.0, pairs=True)
ECG = Expected(frozenset({"ecg", "ekg"}), 2.0, 10_000.0, 60.0)
EMG = Expected(frozenset({"emg"}), 0.1, 10_000.0)


class ElectrodeMonitor(WindowedMonitor):
    """Tells flat lines, rails, hum, open and bridged electrodes, and a wrong unit."""

    def __init__(self, settings: ElectrodeSettings, expected: Expected) -> None:
        self._settings = settings
        self._expected = expected

    def knows(self, stream: SignalStream) -> bool:
        known = stream.type.lower() in self._expected.types and stream.rate_hz > 2.0 * BAND_HZ[1]
        return known and bool(electrodes(stream)[0])

    def begin(self, stream: SignalStream) -> None:
        columns, factors = electrodes(stream)
        self._factors = np.array(factors)
        self.watch(stream, columns, WINDOWS)
        self._streaks["railing"] = Streak(WINDOWS["railing"], len(columns), back=1)
        self._rails = Rails(len(columns))
        width = self._windows.width
        taper = np.hanning(width + 1)[:-1]
        self._taper = taper[:, None] * np.sqrt(2.0 / (stream.rate_hz * float(taper @ taper)))
        frequency = np.arange(width // 2 + 1, dtype=np.float64) * (stream.rate_hz / width)
        self._step = float(frequency[1])
        self._band = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
        self._noise = (frequency >= NOISE_HZ[0]) & (frequency <= NOISE_HZ[1])
        mains = MAINS_HZ if self._settings.mains_hz is None else (self._settings.mains_hz,)
        self._lines = [(each, *_around(frequency, each)) for each in mains]
        self._lines = [line for line in self._lines if line[1].sum() >= 3 and line[2].any()]  # noqa: PLR2004 - all bins of the line itself lie below half the rate

    def _judge(self, window: FloatArray) -> list[SignalFault]:
        window = window * self._factors  # in microvolts
        sent = np.isfinite(window).all(axis=0)
        window = window if sent.all() else np.where(sent, window, 0.0)
        flat, rails = self._rails.evaluate(window)
        moving = window - window.mean(axis=0)
        power = np.abs(np.fft.rfft(moving * self._taper, axis=0)) ** 2  # µV²/Hz
        rms = np.sqrt(power[self._band].sum(axis=0) * self._step)
        alive: BoolArray = sent & ~flat & ~rails
        middle = float(np.median(rms[alive])) if alive.any() else np.nan
        wrong = alive.any() and not self._expected.least_uv <= middle <= self._expected.most_uv
        count = len(self._labels)
        if not wrong and count >= SEVERAL and alive.any():  # an amplifier's own noise
            flat = np.asarray(flat | (sent & (rms < min(0.03 * middle, 0.5))))
        bad: dict[str, BoolArray] = {
            "no values": np.asarray(~sent),
            "wrong unit": np.full(count, wrong),
            "flat line": np.asarray(flat & sent),
            "railing": rails,
        }
        figures: dict[str, object] = {"rms": middle}
        if wrong:  # and nothing else can be said in numbers
            bad |= {kind: np.zeros(count, dtype=np.bool_) for kind in WINDOWS if kind not in bad}
        else:
            alive = np.asarray(alive & ~flat)
            figures |= self._contacts(power, moving, alive, bad)
        return self._told(bad, figures)

    def _contacts(
        self,
        power: FloatArray,
        moving: FloatArray,
        alive: BoolArray,
        bad: dict[str, BoolArray],
    ) -> dict[str, object]:
        """Judge how electrodes touch the skin, into ``bad``; return what is seen of it."""
        hum, mains = self._hum(power)
        noise = np.sqrt(np.median(power[self._noise], axis=0))
        several = alive.any() and len(alive) >= SEVERAL
        usual = float(np.median(noise[alive])) if several else 0.0
        other = self._bridged(moving, alive)
        bad["mains hum"] = np.asarray((hum > self._settings.hum_uv) & ~bad["railing"])
        bad["disconnected electrode"] = np.asarray(
            alive & (noise > max(self._expected.noise, 4.0 * usual))
        )
        bad["bridged electrode"] = other >= 0
        return {"hum": hum, "mains": mains, "noise": noise, "other": other}

    def _told(self, bad: dict[str, BoolArray], seen: dict[str, object]) -> list[SignalFault]:
        """Return the faults that have lasted, the unit's once for the whole stream."""
        faults = []
        for kind, streak in self._streaks.items():
            for at in np.flatnonzero(streak.add(bad[kind])).tolist():
                label = "" if kind == "wrong unit" else self._labels[at]
                faults.append(SignalFault(label, kind, self._message(kind, at, seen)))
                if not label:
                    break
        return faults

    def _message(self, kind: str, channel: int, seen: dict[str, object]) -> str:
        """Return the message about a channel; a report may outlast the measured fault."""
        figures: dict[str, Any] = {"hum": 0.0, "mains": 0, "noise": 0.0, "other": -1}
        for name, value in seen.items():
            figures[name] = value[channel] if isinstance(value, np.ndarray) else value
        other = figures["other"]
        figures["other"] = self._labels[other] if other >= 0 else "another one"
        return ADVICE[kind].format(**figures)

    def _hum(self, power: FloatArray) -> tuple[FloatArray, int]:
        """Return each channel's hum in µV, 0 where none stands out, and its frequency in Hz."""
        hum, loudest = np.zeros(power.shape[1]), 0
        for mains, line, beside in self._lines:
            floor = np.median(power[beside], axis=0)
            within = power[line].sum(axis=0)
            out = within > HUM_RATIO * floor * line.sum()
            found = np.where(out, np.sqrt(within * self._step), 0.0)
            if found.max() > hum.max():
                loudest = mains
            hum = np.maximum(hum, found)
        return hum, loudest

    def _bridged(
        self, moving: FloatArray, alive: BoolArray
    ) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
        """Return for each channel the one it is bridged with, -1 for none."""
        count = len(alive)
        other = np.full(count, -1)
        if not self._expected.pairs or alive.sum() < SEVERAL:
            return other
        products = moving.T @ moving / len(moving)
        variance = np.diag(products)
        apart = variance[:, None] + variance[None, :] - 2.0 * products
        apart[~alive] = np.inf
        apart[:, ~alive] = np.inf
        np.fill_diagonal(apart, np.inf)
        usual = float(np.median(apart[np.isfinite(apart)]))
        nearest = apart.argmin(axis=1)
        least = apart[np.arange(count), nearest]
        same = least < min(0.12**2 * usual, 2.0**2)
        other[same] = nearest[same]
        return other


def _around(frequency: FloatArray, mains: int) -> tuple[BoolArray, BoolArray]:
    """Return the bins of a mains line, and those beside it."""
    away = np.abs(frequency - mains)
    line: BoolArray = away <= 1.5  # noqa: PLR2004 - the width of the Hann window's main lobe, Hz
    return line, (away >= 3.0) & (away <= 6.5)  # noqa: PLR2004
